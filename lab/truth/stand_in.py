"""A robot that shares no code with the simulator of SERD: own walls, wheels, lidar and pilot.

Two driven wheels follow their commanded speeds with a lag, and slip at random; odometry counts the
wheels and drifts. Walls are segments; a body that would touch one stays. The lidar casts rays at
the segments. A pilot steers at one place after another.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from serd_core.arrays import FloatArray

STEP_S = 0.05
_LAG_S, _TRACK_M, _SLIP, _RADIUS_M = 0.25, 0.32, 0.03, 0.18
_N_RAYS, _REACH_M = 180, 8.0
_ARRIVED_M = 0.15


def walls_of(*rings_m: list[tuple[float, float]]) -> FloatArray:
    """(W, 4) segments x0, y0, x1, y1 of closed rings."""
    parts = [np.hstack([ring, np.roll(ring, -1, axis=0)]) for ring in map(np.array, rings_m)]
    return np.concatenate(parts).astype(np.float64) if parts else np.zeros((0, 4))


@dataclass
class Rover:
    """A robot in a place. pose, odometry: x, y, yaw; command: forward and turning speed."""

    walls: FloatArray
    rng: np.random.Generator
    pose: FloatArray = field(default_factory=lambda: np.zeros(3))
    odometry: FloatArray = field(default_factory=lambda: np.zeros(3))
    command: tuple[float, float] = (0.0, 0.0)
    time_s: float = 0.0
    drift: float = 0.002
    _wheels: FloatArray = field(default_factory=lambda: np.zeros(2))

    def step(self) -> None:
        """Move for one step."""
        forward, turning = self.command
        wanted = np.array([forward - turning * _TRACK_M / 2, forward + turning * _TRACK_M / 2])
        self._wheels += (wanted - self._wheels) * STEP_S / _LAG_S
        rolled = self._wheels * STEP_S
        slipped = rolled * (1.0 + _SLIP * self.rng.standard_normal(2))
        before = self.pose
        self.pose = _moved(self.pose, slipped)
        counted = rolled
        if self._touches():
            self.pose = np.array([*before[:2], self.pose[2]])
            counted = np.array([-1.0, 1.0]) * (rolled[1] - rolled[0]) / 2
        noise = self.drift * np.abs(counted) * self.rng.standard_normal(2)
        self.odometry = _moved(self.odometry, counted + noise)
        self.time_s += STEP_S

    def _touches(self) -> bool:
        if not len(self.walls):
            return False
        start, way = self.walls[:, :2], self.walls[:, 2:] - self.walls[:, :2]
        share = ((self.pose[:2] - start) * way).sum(axis=1) / (way**2).sum(axis=1)
        nearest = start + np.clip(share, 0.0, 1.0)[:, None] * way
        return bool(np.linalg.norm(nearest - self.pose[:2], axis=1).min() < _RADIUS_M)

    def scan(self) -> FloatArray:
        """(R,) distances around, inf where no wall is within reach."""
        angles = self.pose[2] + np.linspace(-np.pi, np.pi, _N_RAYS, endpoint=False)
        ranges = np.full(_N_RAYS, np.inf)
        if len(self.walls):
            ways = np.stack([np.cos(angles), np.sin(angles)], axis=1)[:, None]
            start, edge = self.walls[:, :2] - self.pose[:2], self.walls[:, 2:] - self.walls[:, :2]
            cross = ways[..., 0] * edge[:, 1] - ways[..., 1] * edge[:, 0]
            with np.errstate(divide="ignore", invalid="ignore"):
                along = (start[:, 0] * edge[:, 1] - start[:, 1] * edge[:, 0]) / cross
                share = (start[:, 0] * ways[..., 1] - start[:, 1] * ways[..., 0]) / cross
            hit = (along > 0) & (share >= 0) & (share <= 1)
            ranges = np.where(hit, along, np.inf).min(axis=1)
        ranges = ranges + 0.01 * self.rng.standard_normal(_N_RAYS)
        return np.asarray(np.where(ranges < _REACH_M, ranges, np.inf))

    def steer_at(self, place_m: FloatArray, fastest_mps: float) -> bool:
        """Command speeds toward a place in the frame of the odometry; whether it is there."""
        away = place_m - self.odometry[:2]
        distance = float(np.hypot(*away))
        if distance < _ARRIVED_M:
            self.command = (0.0, 0.0)
            return True
        error = np.arctan2(away[1], away[0]) - self.odometry[2]
        error = float((error + np.pi) % (2 * np.pi) - np.pi)
        forward = fastest_mps * max(np.cos(error), 0.0) ** 2 if abs(error) < 0.9 else 0.0
        self.command = (min(forward, distance), float(np.clip(2.5 * error, -1.5, 1.5)))
        return False


def _moved(pose: FloatArray, rolled: FloatArray) -> FloatArray:
    turn, way = (rolled[1] - rolled[0]) / _TRACK_M, rolled.mean()
    middle = pose[2] + turn / 2
    moved: FloatArray = pose + np.array([way * np.cos(middle), way * np.sin(middle), turn])
    return moved


#: Where a drive goes: places one after another, each followed by a pause (s).
Way = list[tuple[float, float, float]]


@dataclass(frozen=True, eq=False)
class Logged:
    """time_s (T,); pose, odometry (T, 3); command (T, 2); scans (T, R); people (T, P, 2)."""

    time_s: FloatArray
    pose: FloatArray
    odometry: FloatArray
    command: FloatArray
    scans: FloatArray
    people: FloatArray


def recorded(
    rover: Rover,
    ways: list[Way],
    fastest_mps: float,
    *,
    person: Callable[[float], FloatArray] | None = None,
) -> Logged:
    """What the rover does on its ways, at every second step; person: place at a time (s)."""
    rows = list(_drive(rover, ways, fastest_mps, person))
    return Logged(*(np.array(column) for column in zip(*rows, strict=True)))


Row = tuple[float, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]


def _drive(
    rover: Rover,
    ways: list[Way],
    fastest_mps: float,
    person: Callable[[float], FloatArray] | None,
) -> Iterator[Row]:
    def two_steps() -> Row:
        people = np.zeros((0, 2)) if person is None else person(rover.time_s)[None]
        row = (
            rover.time_s,
            rover.pose,
            rover.odometry,
            np.array(rover.command),
            rover.scan(),
            people,
        )
        rover.step()
        rover.step()
        return row

    for way in ways:
        for x_m, y_m, pause_s in way:
            until_s = rover.time_s + 60.0
            while not rover.steer_at(np.array([x_m, y_m]), fastest_mps) and rover.time_s < until_s:
                yield two_steps()
            for _ in range(round(pause_s / (2 * STEP_S))):
                rover.command = (0.0, 0.0)
                yield two_steps()
