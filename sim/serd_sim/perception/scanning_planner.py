"""A planner that detects people in lidar scans only, and how scans are matched to observations."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from serd_bag.nearest import choice_rule
from serd_sim.errors import SimError
from serd_sim.perception.scan_people import ScanPerception
from serd_sim.planning.local_planner import LocalPlanner, RecoveringPlanner, make_planner
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.command import Command
from serd_sim.world.observation import Observation
from serd_sim.world.waypoint import Waypoint

if TYPE_CHECKING:  # it imports PyBullet
    from serd_sim.world.world import HallwayWorld

#: Source of people: as the world gives them, or from the lidar's scans alone.
PEOPLE_SOURCES = ("given", "scan")
#: Returns the scan taken at an observation, None when there is no new one.
ScanSource = Callable[[Observation], NDArray[np.float32] | None]


class ScanningPlanner(RecoveringPlanner):
    """A planner with recoveries, for which people as given are replaced by those in the scans.

    scan_of: None where the caller passes scans to the perception.
    """

    def __init__(
        self,
        planner: LocalPlanner,
        scenario: Scenario,
        perception: ScanPerception,
        scan_of: ScanSource | None = None,
    ) -> None:
        self.perception, self._scan_of = perception, scan_of
        super().__init__(planner, scenario)

    def reset(self) -> None:
        """Discard all state, at the start of an episode."""
        super().reset()
        self.perception.reset()

    def step(self, observation: Observation, waypoint: Waypoint | None) -> Command:
        """The planner's command for the people the scans have shown."""
        ranges_m = None if self._scan_of is None else self._scan_of(observation)
        if ranges_m is not None:
            self.perception.take(observation, ranges_m)
        return super().step(self.perception.see(observation), waypoint)


def require_people_source(name: str) -> None:
    """SimError with the nearest name when `name` is none of PEOPLE_SOURCES."""
    if name not in PEOPLE_SOURCES:
        raise SimError(choice_rule("people_from", name, PEOPLE_SOURCES))


def planner_in_world(world: "HallwayWorld", people_from: str = "given") -> RecoveringPlanner:
    """A planner that drives in a world with people from the given source."""
    require_people_source(people_from)
    planner = make_planner(world.scenario)
    if people_from == "given":
        return planner
    return ScanningPlanner(
        planner.planner,
        world.scenario,
        ScanPerception(world.scenario),
        lambda seen: world.scan(seen) if world.is_scan_tick else None,
    )


class ScanMatcher:
    """Matches each scan with the observation of its stamp, and finds people in it.

    Scans and observations may come in any order; each scan is taken once.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._perception = ScanPerception(scenario)
        self._scan: tuple[int, NDArray[np.float32]] | None = None
        self._observation: tuple[int, Observation] | None = None
        self._taken_ns: int | None = None

    def planner_on(self, planner: RecoveringPlanner) -> ScanningPlanner:
        """The planner with the people that these scans show."""
        return ScanningPlanner(planner.planner, self._scenario, self._perception)

    def reset(self) -> None:
        """Take scans of any stamp again, at the start of a session; one that waits is kept."""
        self._taken_ns = None

    def take_scan(self, time_ns: int, ranges_m: NDArray[np.float32]) -> None:
        """Take the ranges (n_rays,) of a scan; SimError where their number is not the lidar's."""
        self._scan = time_ns, ranges_m
        self._match()

    def take_observation(self, observation: Observation) -> None:
        """Take the observation of a tick."""
        self._observation = _stamp_ns(observation), observation
        self._match()

    def _match(self) -> None:
        if self._scan is None or self._observation is None:
            return
        time_ns, ranges_m = self._scan
        if time_ns == self._observation[0] != self._taken_ns:
            self._taken_ns = time_ns
            self._perception.take(self._observation[1], ranges_m)


def _stamp_ns(observation: Observation) -> int:
    return round(observation.time_s * 1e9)
