"""People round a robot by its own lidar, whose scans and poses have stamps of their own.

Each scan is taken at the pose that the robot had at its stamp, interpolated between poses. A scan
that is old, mostly without ranges, or unchanged while the robot moves shows no people, which does
not mean that there are none: the answer is then the fault.
"""

from collections import deque

from serd_sim.perception.scan_people import WALL_MARGIN_M, ScanPerception
from serd_sim.safety.input_monitor import ScanMonitor
from serd_sim.safety.known_space import KnownSpace
from serd_sim.safety.motion import PoseTrack
from serd_sim.safety.reasons import Fault
from serd_sim.safety.scan import Scan
from serd_sim.safety.settings import GuardSettings
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.observation import Observation, People

_MOST_WAITING = 20
_MEMORY_S = 4.0


class LidarPeople:
    """Takes scans and observations in any order; each scan is taken once.

    settings: `source_timeout`, `blind_rays` and `frozen_motion` are used. wall_margin_m: as in
    `people_in_scan`.
    """

    def __init__(
        self, scenario: Scenario, settings: GuardSettings, wall_margin_m: float = WALL_MARGIN_M
    ) -> None:
        self._settings, self._walls_m = settings, scenario.wall_segments_m
        self._perception = ScanPerception(scenario, wall_margin_m)
        self._waiting: deque[Scan] = deque(maxlen=_MOST_WAITING)
        self.reset()

    def reset(self) -> None:
        """Discard tracks and poses, after a jump of the clock; scans that wait are kept."""
        self._perception.reset()
        self._poses = PoseTrack(_MEMORY_S)
        space = KnownSpace(self._settings, self._walls_m, 0.0)
        self._monitor = ScanMonitor(self._settings, self._poses, space)
        self._taken_s: float | None = None
        self._received_s: float | None = None

    def take_scan(self, scan: Scan) -> None:
        """Take a scan; it waits for the next observation that is not older."""
        self._received_s = scan.stamp_s
        self._waiting.append(scan)

    def step(self, observation: Observation) -> People | Fault:
        """The people at an observation, newer than the last one, or why the scans show none."""
        time_s = observation.time_s
        self._poses.append(time_s, observation.pose)
        waiting = list(self._waiting)
        self._waiting.clear()
        for scan in waiting:
            if scan.stamp_s > time_s:
                self._waiting.append(scan)
            elif self._is_next(scan):
                self._take(scan)
        return self._fault(time_s) or self._perception.see(observation).people

    def _is_next(self, scan: Scan) -> bool:
        is_new = self._taken_s is None or scan.stamp_s > self._taken_s
        return is_new and self._poses.covers(scan.stamp_s)

    def _take(self, scan: Scan) -> None:
        self._taken_s = scan.stamp_s
        pose = self._poses.at(scan.stamp_s)
        interpreted = self._monitor.take(scan, pose, pose=pose)
        if self._monitor.check()[0] > 0.0:
            self._perception.take_scan(interpreted, pose)

    def _fault(self, time_s: float) -> Fault | None:
        timeout_s = self._settings.source_timeout
        if self._taken_s is None or time_s - self._taken_s >= timeout_s:
            off_s = 0.0 if self._received_s is None else self._received_s - time_s
            if off_s >= timeout_s:
                return Fault.FUTURE
            return Fault.MISSING if self._taken_s is None and off_s > -timeout_s else Fault.STALE
        share, fault = self._monitor.check()
        return fault if share <= 0.0 else None
