"""A planner that knows of people only what the lidar tells."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from sim.command import Command
from sim.local_planner import LocalPlanner
from sim.observation import Observation
from sim.perception.scan_perception import ScanPerception
from sim.waypoint import Waypoint
from sim.world import HallwayWorld

#: Gives the scan taken at an observation, None when there is no new one.
ScanSource = Callable[[Observation], NDArray[np.float32] | None]


class ScanningPlanner:
    """Wraps any planner: people as given are replaced by people as tracked in scans."""

    def __init__(
        self, planner: LocalPlanner, perception: ScanPerception, scan_of: ScanSource
    ) -> None:
        self.planner = planner
        self.perception = perception
        self._scan_of = scan_of

    @property
    def is_blocked(self) -> bool:
        """Whether every way to move was forbidden when it was asked last."""
        return self.planner.is_blocked

    def reset(self) -> None:
        """Forget the past, at the start of an episode."""
        self.planner.reset()
        self.perception.reset()

    def step(self, observation: Observation, waypoint: Waypoint | None) -> Command:
        """The planner's command for the people the scans have shown."""
        seen = self.perception.see(observation, self._scan_of(observation))
        return self.planner.step(seen, waypoint)


def scans_of(world: HallwayWorld) -> ScanSource:
    """The lidar of a world in process, at its own rate."""
    return lambda observation: world.scan(observation) if world.is_scan_tick else None
