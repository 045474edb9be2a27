"""Matches each scan with the observation of its stamp, and finds people in it."""

import numpy as np
from numpy.typing import NDArray

from sim.perception.scan_people import ScanPerception
from sim.perception.scanning_planner import ScanningPlanner, no_scans
from sim.planning.recovery import RecoveringPlanner
from sim.scenario.scenario import Scenario
from sim.world.observation import Observation


class ScanMatcher:
    """Scans and observations may come in any order; each scan is taken once."""

    def __init__(self, scenario: Scenario) -> None:
        self._ticks_per_scan = scenario.ticks_per_scan
        self._perception = ScanPerception(scenario)
        self._scan: tuple[int, NDArray[np.float32]] | None = None
        self._observation: tuple[int, Observation] | None = None
        self._taken_ns: int | None = None

    def planner_on(self, planner: RecoveringPlanner) -> ScanningPlanner:
        """The planner with the people that these scans show."""
        return ScanningPlanner(planner, self._perception, no_scans)

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

    def is_complete(self, observation: Observation) -> bool:
        """Whether the scan of this tick has been taken, or the tick has none."""
        if observation.tick % self._ticks_per_scan:
            return True
        return self._taken_ns == _stamp_ns(observation)

    def _match(self) -> None:
        if self._scan is None or self._observation is None:
            return
        time_ns, ranges_m = self._scan
        if time_ns == self._observation[0] != self._taken_ns:
            self._taken_ns = time_ns
            self._perception.take(self._observation[1], ranges_m)


def _stamp_ns(observation: Observation) -> int:
    return round(observation.time_s * 1e9)
