"""People in lidar scans: what the map does not explain, cut into bodies, and tracked.

Rays that end away from every wall are grouped while their end points stay close together; a group
wider than one body is split. Of a round body of radius r only the near side is seen, on average
pi/4 r before its centre. Tracks take the nearest detections by an alpha-beta filter:

    x+ = x + v dt;  r = z - x+;  x = x+ + alpha r;  v = v + beta / dt r

A lidar whose scans and poses have stamps of their own is read at the poses that the robot had at
the stamps. A scan that is old, mostly without ranges, or unchanged while the robot moves shows no
people, which does not mean that there are none: the answer is then the fault.
"""

import math
from collections import deque
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from serd_core.arrays import FloatArray, IntArray
from serd_sim.crowd.social_force import model_named
from serd_sim.safety.input_monitor import ScanMonitor
from serd_sim.safety.known_space import KnownSpace
from serd_sim.safety.motion import PoseTrack, compose
from serd_sim.safety.reasons import Fault
from serd_sim.safety.scan import Scan
from serd_sim.safety.settings import GuardSettings
from serd_sim.scenario.occupancy import WallDistanceRaster, wall_distance_raster
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.observation import Observation, People, Pose

_ALPHA, _BETA = 0.6, 0.25
#: How far a detection may be from a track's prediction.
_GATE_M = 0.6
#: Life unseen.
_MEMORY_S = 0.5
FASTEST_MPS = 2.0


class PeopleTracker:
    """Positions, velocities and lasting numbers of people, from detections to detections."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Discard all tracks."""
        self.position_m: FloatArray = np.zeros((0, 2))
        self.velocity_mps: FloatArray = np.zeros((0, 2))
        self.identity: IntArray = np.zeros(0, dtype=np.int64)
        self._seen_s: FloatArray = np.zeros(0)
        self._time_s: float | None = None
        self._updated_s: float | None = None
        self._next_identity = 0

    def predict(self, time_s: float) -> None:
        """Move all tracks on to a time."""
        if self._time_s is not None:
            self.position_m = self.position_m + (time_s - self._time_s) * self.velocity_mps
        self._time_s = time_s

    def update(self, detections_m: FloatArray, time_s: float) -> None:
        """Take the (K, 2) detections of a scan at a time."""
        # Not since the last prediction, which may be later than this scan.
        step_s = 0.1 if self._updated_s is None else max(time_s - self._updated_s, 1e-3)
        self._updated_s = time_s
        self.predict(time_s)
        free = np.ones(len(detections_m), dtype=np.bool_)
        for track, detection in self._pairs(detections_m):
            self._correct(track, detections_m[detection], step_s)
            self._seen_s[track] = time_s
            free[detection] = False
        known = time_s - self._seen_s <= _MEMORY_S
        new_m = detections_m[free]
        numbers = self._next_identity + np.arange(len(new_m), dtype=np.int64)
        self._next_identity += len(new_m)
        self.position_m = np.concatenate([self.position_m[known], new_m])
        self.velocity_mps = np.concatenate([self.velocity_mps[known], np.zeros_like(new_m)])
        self.identity = np.concatenate([self.identity[known], numbers])
        self._seen_s = np.concatenate([self._seen_s[known], np.full(len(new_m), time_s)])

    def _pairs(self, detections_m: FloatArray) -> list[tuple[int, int]]:
        """Track and detection numbers, nearest first, each at most once, within the gate."""
        away = np.linalg.norm(self.position_m[:, None] - detections_m[None, :], axis=2)
        pairs: list[tuple[int, int]] = []
        tracks, detections = np.nonzero(away < _GATE_M)
        for best in np.argsort(away[tracks, detections], kind="stable"):
            track, detection = int(tracks[best]), int(detections[best])
            if all(track != t and detection != d for t, d in pairs):
                pairs.append((track, detection))
        return pairs

    def _correct(self, track: int, detection_m: FloatArray, step_s: float) -> None:
        residual = detection_m - self.position_m[track]
        self.position_m[track] += _ALPHA * residual
        velocity = self.velocity_mps[track] + _BETA / step_s * residual
        speed = float(np.hypot(*velocity))
        self.velocity_mps[track] = velocity * min(1.0, FASTEST_MPS / max(speed, 1e-9))


WALL_MARGIN_M = 0.12
_SAME_BODY_M = 0.25
_SKIPPED_RAYS = 2
_MOST_GROUPS = 500


def people_in_scan(
    ranges_m: NDArray[np.float32],
    angles_rad: FloatArray,
    pose: Pose,
    walls: WallDistanceRaster,
    person_radius_m: float,
    wall_margin_m: float = WALL_MARGIN_M,
) -> FloatArray:
    """(K, 2) estimated centres of people, in the map.

    ranges_m, angles_rad: (n_rays,), not finite where there is no return. pose: of the lidar.
    wall_margin_m: points nearer than this to a wall belong to it. Of more groups than
    `_MOST_GROUPS` the nearest count.
    """
    rays = np.flatnonzero(np.isfinite(ranges_m))
    angle_rad, reach_m = angles_rad[rays] + pose[2], ranges_m[rays].astype(np.float64)
    x_m, y_m = pose[0] + reach_m * np.cos(angle_rad), pose[1] + reach_m * np.sin(angle_rad)
    free = walls.at(x_m, y_m) > wall_margin_m
    rays, x_m, y_m = rays[free], x_m[free], y_m[free]
    if not len(rays):
        return np.zeros((0, 2))
    apart = np.hypot(np.diff(x_m), np.diff(y_m)) > _SAME_BODY_M
    breaks = np.flatnonzero(apart | (np.diff(rays) > _SKIPPED_RAYS)) + 1
    groups = np.split(np.stack([x_m, y_m], axis=1), breaks)
    if len(groups) > 1 and _continues_around(rays, groups, len(angles_rad)):
        groups[0] = np.concatenate([groups.pop(), groups[0]])
    if len(groups) > _MOST_GROUPS:  # of noise, which the tracker would compare for minutes
        groups.sort(key=lambda group: math.hypot(*(group[0] - pose[:2])))
        del groups[_MOST_GROUPS:]
    centers = [
        center
        for group in groups
        for body in _bodies_of(group, person_radius_m)
        if (center := _center_of(body, pose, person_radius_m)) is not None
    ]
    return np.array(centers).reshape(-1, 2)


def _continues_around(rays: NDArray[np.intp], groups: list[FloatArray], n_rays: int) -> bool:
    """Whether the last group goes on in the first one, across the scan's seam."""
    near = float(np.hypot(*(groups[-1][-1] - groups[0][0]))) <= _SAME_BODY_M
    return near and rays[0] + n_rays - rays[-1] <= _SKIPPED_RAYS


def _bodies_of(group: FloatArray, person_radius_m: float) -> list[FloatArray]:
    """The group cut into as many equal parts as bodies fit side by side."""
    width = float(np.hypot(*(group[-1] - group[0])))
    count = max(1, math.floor(width / (2.0 * person_radius_m) + 0.4))
    return [part for part in np.array_split(group, count) if len(part)]


def _center_of(body: FloatArray, pose: Pose, person_radius_m: float) -> FloatArray | None:
    """Centre behind the seen surface; None for a single stray point close by."""
    seen = body.mean(axis=0)
    away = seen - np.array(pose[:2])
    distance = float(np.hypot(*away))
    if len(body) < 2 and distance < 4.0:
        return None
    center: FloatArray = seen + 0.25 * math.pi * person_radius_m * away / max(distance, 1e-6)
    return center


class ScanPerception:
    """Replaces the people of observations by those tracked in scans."""

    def __init__(self, scenario: Scenario, wall_margin_m: float = WALL_MARGIN_M) -> None:
        self.tracker = PeopleTracker()
        self._people_in = partial(
            people_in_scan,
            walls=wall_distance_raster(scenario),
            person_radius_m=model_named(scenario.pedestrians.model).body_radius_m,
            wall_margin_m=wall_margin_m,
        )
        self._angles_rad = scenario.lidar.angles_rad

    def reset(self) -> None:
        """Discard all tracks, at the start of an episode."""
        self.tracker.reset()

    def take(self, observation: Observation, ranges_m: NDArray[np.float32]) -> None:
        """Take the scan (n_rays,) that was made at an observation's time and pose."""
        found = self._people_in(ranges_m, self._angles_rad, observation.pose)
        self.tracker.update(found, observation.time_s)

    def take_scan(self, scan: Scan, robot: Pose) -> None:
        """Take a scan of any lidar, with the pose of the robot when it was made.

        Many simulated lidars send range_max for rays that meet nothing.
        """
        ends = scan.valid & (scan.ranges_m < scan.geometry.range_max_m)
        ranges_m = np.where(ends, scan.ranges_m, np.float32(np.inf))
        lidar = robot if scan.mount is None else compose(robot, scan.mount)
        self.tracker.update(self._people_in(ranges_m, scan.angles_rad, lidar), scan.stamp_s)

    def see(self, observation: Observation) -> Observation:
        """The observation with the tracked people, predicted to its time, as its people."""
        self.tracker.predict(observation.time_s)
        return replace(
            observation,
            people_position_m=self.tracker.position_m,
            people_velocity_mps=self.tracker.velocity_mps,
            people_id=self.tracker.identity,
        )


_MOST_WAITING = 20
_POSES_S = 4.0


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
        self._poses = PoseTrack(_POSES_S)
        space = KnownSpace(self._settings, self._walls_m, 0.0)
        self._monitor = ScanMonitor(self._settings, self._poses, space)
        self._taken_s: float | None = None
        self._received_s: float | None = None

    def change(self, settings: GuardSettings) -> None:
        """Go on with other limits of the scans."""
        self._settings = self._monitor.settings = settings

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
