"""Rigid motions in the plane, and poses of the last seconds."""

import math
from bisect import bisect_left, bisect_right

import numpy as np

from serd_core.arrays import FloatArray

Pose = tuple[float, float, float]
STANDING: Pose = (0.0, 0.0, 0.0)


def motion_between(start: Pose, end: Pose) -> Pose:
    """(x_m, y_m, yaw_rad) of `end` in the frame of `start`."""
    x_m, y_m = end[0] - start[0], end[1] - start[1]
    cos, sin = math.cos(start[2]), math.sin(start[2])
    turn = math.remainder(end[2] - start[2], math.tau)
    return cos * x_m + sin * y_m, cos * y_m - sin * x_m, turn


def compose(outer: Pose, inner: Pose) -> Pose:
    """The pose `inner`, given in the frame whose pose is `outer`, in the frame of `outer`."""
    x_m, y_m, yaw_rad = outer
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    yaw = yaw_rad + inner[2]
    return (
        float(x_m + cos * inner[0] - sin * inner[1]),
        float(y_m + sin * inner[0] + cos * inner[1]),
        float(np.arctan2(np.sin(yaw), np.cos(yaw))),
    )


def in_frame(points_m: FloatArray, frame: Pose) -> FloatArray:
    """(N, 2) points in the frame of a pose."""
    return rotated(points_m, -frame[2], frame[:2])


def out_of_frame(points_m: FloatArray, frame: Pose) -> FloatArray:
    """(N, 2) points that are given in the frame of a pose."""
    points_m = rotated(points_m, frame[2]) if frame[2] != 0.0 else points_m
    offset_m: FloatArray = np.array(frame[:2])
    return points_m + offset_m


def rotated(
    vectors: FloatArray, angle_rad: float, centre: tuple[float, float] = (0.0, 0.0)
) -> FloatArray:
    """(N, 2) vectors from a centre, turned by an angle."""
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)
    x, y = vectors[:, 0] - centre[0], vectors[:, 1] - centre[1]
    turned: FloatArray = np.empty((len(vectors), 2))
    turned[:, 0], turned[:, 1] = cos * x - sin * y, sin * x + cos * y
    return turned


def is_finite(pose: Pose) -> bool:
    """Whether all three are numbers."""
    return all(map(math.isfinite, pose))


class PoseTrack:
    """Poses of the last seconds, by stamp."""

    def __init__(self, memory_s: float) -> None:
        self._memory_s = memory_s
        self._stamps_s: list[float] = []
        self._poses: list[Pose] = []

    def covers(self, stamp_s: float) -> bool:
        """Whether a time is between the first and the newest stamp."""
        return bool(self._poses) and self._stamps_s[0] <= stamp_s <= self._stamps_s[-1]

    def __len__(self) -> int:
        return len(self._poses)

    @property
    def pose(self) -> Pose:
        """The newest pose."""
        return self._poses[-1]

    def first_since(self, stamp_s: float) -> tuple[float, Pose] | None:
        """Stamp and pose of the first that is not older than a time, None before it has come."""
        at = bisect_left(self._stamps_s, stamp_s)
        return (self._stamps_s[at], self._poses[at]) if at < len(self._poses) else None

    def last_until(self, stamp_s: float) -> tuple[float, Pose] | None:
        """Stamp and pose of the last that is not newer than a time, None without one."""
        at = bisect_right(self._stamps_s, stamp_s)
        return (self._stamps_s[at - 1], self._poses[at - 1]) if at else None

    def append(self, stamp_s: float, pose: Pose) -> None:
        """Take a pose, newer than the last."""
        self._stamps_s.append(stamp_s)
        self._poses.append(pose)
        old = bisect_left(self._stamps_s, stamp_s - self._memory_s)
        if old > len(self._poses) // 2:
            del self._stamps_s[:old], self._poses[:old]

    def at(self, stamp_s: float) -> Pose:
        """The pose at a time, on the line between its neighbours; the nearest outside them."""
        after = bisect_left(self._stamps_s, stamp_s)
        if after == len(self._poses):
            return self._poses[-1]
        if after == 0 or self._stamps_s[after] == stamp_s:
            return self._poses[after]
        start_s, end_s = self._stamps_s[after - 1 : after + 1]
        start, end = self._poses[after - 1 : after + 1]
        share = (stamp_s - start_s) / (end_s - start_s)
        turn = math.remainder(end[2] - start[2], math.tau)
        return (
            start[0] + share * (end[0] - start[0]),
            start[1] + share * (end[1] - start[1]),
            start[2] + share * turn,
        )
