"""A planner that detects people in lidar scans only."""

from collections.abc import Callable
from copy import deepcopy
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sim.perception.scan_people import ScanPerception
from sim.planning.local_planner import PlannerStatus
from sim.planning.recovery import RecoveringPlanner
from sim.scenario.scenario import Scenario
from sim.world.command import Command
from sim.world.observation import Observation
from sim.world.waypoint import Waypoint

#: Returns the scan taken at an observation, None when there is no new one.
ScanSource = Callable[[Observation], NDArray[np.float32] | None]


class Scanner(Protocol):
    """A world with a lidar."""

    @property
    def scenario(self) -> Scenario:
        """The place."""
        ...

    @property
    def is_scan_tick(self) -> bool:
        """Whether the lidar has a new scan now."""
        ...

    def scan(self, observation: Observation | None = None) -> NDArray[np.float32]:
        """(n_rays,) ranges from an observed pose."""
        ...


class ScanningPlanner:
    """Wraps a planner and its recoveries: people as given are replaced by those in the scans."""

    def __init__(
        self, planner: RecoveringPlanner, perception: ScanPerception, scan_of: ScanSource
    ) -> None:
        self.planner = planner
        self.perception = perception
        self._scan_of = scan_of

    @property
    def is_blocked(self) -> bool:
        """Whether every motion was forbidden at the last step."""
        return self.planner.is_blocked

    @property
    def status(self) -> PlannerStatus:
        """The status of the planner, named as in Nav2."""
        return self.planner.status

    @property
    def n_recoveries(self) -> int:
        """Recoveries begun so far."""
        return self.planner.n_recoveries

    def reset(self) -> None:
        """Discard all state, at the start of an episode."""
        self.planner.reset()
        self.perception.reset()

    def step(self, observation: Observation, waypoint: Waypoint | None) -> Command:
        """The planner's command for the people the scans have shown."""
        ranges_m = self._scan_of(observation)
        if ranges_m is not None:
            self.perception.take(observation, ranges_m)
        return self.planner.step(self.perception.see(observation), waypoint)

    def snapshot(self) -> tuple[RecoveringPlanner, ScanPerception]:
        """Copy of the planner and of the tracked people; it can be pickled."""
        return deepcopy((self.planner, self.perception))

    def restore(self, state: tuple[RecoveringPlanner, ScanPerception]) -> None:
        """Return to a snapshot; later steps repeat exactly."""
        self.planner, self.perception = deepcopy(state)


def scans_of(world: Scanner) -> ScanSource:
    """The lidar of a world in process, at its own rate."""
    return lambda observation: world.scan(observation) if world.is_scan_tick else None


def no_scans(_: Observation) -> None:
    """Source without scans, for callers that pass scans to the perception themselves."""
