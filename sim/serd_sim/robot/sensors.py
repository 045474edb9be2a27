"""The sensors of the robot: a 2-D lidar against walls, obstacles and people, and odometry.

A ray meets a wall segment where both parameters of the crossing are in range, and a body's circle
at along - sqrt(r^2 - across^2). Tests compare it with the ray tests of the physics world, which
agree to millimetres.

Odometry is where the robot believes it is from its wheels alone. Each control period the motion in
the robot's frame, (d, dyaw), is that of the wheels, which slip, or the true one where the robot has
no wheels. It is reported as

    d (1 + s_d) + n_d sqrt(|d|),   dyaw (1 + s_w) + n_w sqrt(|d|)

with scale errors s drawn once per episode and fresh normal n. Deviations of 0 add nothing.
"""

import math

import numpy as np
from numpy.typing import NDArray

from serd_core.arrays import FloatArray
from serd_sim.scenario.settings import LidarSettings, OdometrySettings
from serd_sim.world.observation import Pose


class Lidar:
    """Scans among walls (W, 2, 2) and round people of one radius."""

    def __init__(
        self, settings: LidarSettings, walls_m: FloatArray, person_radius_m: float
    ) -> None:
        self._settings = settings
        self._walls_m = walls_m
        self._person_radius_m = person_radius_m
        self.angles_rad = settings.angles_rad

    def scan(
        self,
        pose: Pose,
        people_x_m: FloatArray,
        people_y_m: FloatArray,
        rng: np.random.Generator | None = None,
    ) -> NDArray[np.float32]:
        """(n_rays,) distance along each ray from the robot's centre; inf where nothing is hit, -inf
        where it is nearer than range_min (REP 117).

        With an rng, every range that hits something carries the sensor's noise.
        """
        settings = self._settings
        angle = self.angles_rad + pose[2]
        ray_x, ray_y = np.cos(angle), np.sin(angle)
        walls_m = self._walls_m
        start_m, along_m = walls_m[:, 0] - pose[:2], walls_m[:, 1] - walls_m[:, 0]
        ranges = range_to_lines(start_m[:, 0], start_m[:, 1], along_m, ray_x, ray_y)
        to_x, to_y, radius_m = people_x_m - pose[0], people_y_m - pose[1], self._person_radius_m
        near = to_x * to_x + to_y * to_y < (settings.range_max_m + radius_m) ** 2
        to_x, to_y = to_x[near], to_y[near]
        along = ray_x[:, None] * to_x + ray_y[:, None] * to_y
        inside = radius_m**2 - (to_x * to_x + to_y * to_y - along * along)
        hit = (inside > 0.0) & (along > 0.0)
        distance = np.where(hit, along - np.sqrt(np.maximum(inside, 0.0)), np.inf)
        np.minimum(ranges, distance.min(axis=1, initial=np.inf), out=ranges)
        if rng is not None and settings.noise_deviation_m > 0:
            ranges = ranges + settings.noise_deviation_m * rng.standard_normal(len(ranges))
        ranges = np.where(ranges > settings.range_max_m, np.inf, ranges)
        return np.where(ranges < settings.range_min_m, -np.inf, ranges).astype(np.float32)


def range_to_lines(
    to_x: FloatArray, to_y: FloatArray, along_m: FloatArray, ray_x: FloatArray, ray_y: FloatArray
) -> FloatArray:
    """(n_rays,) distances along rays to the nearest of segments; arguments as of `crossings`."""
    crossed_m = crossings(to_x, to_y, along_m, ray_x, ray_y)
    nearest: FloatArray = crossed_m.min(axis=1, initial=np.inf)
    return nearest


def crossings(
    to_x: FloatArray, to_y: FloatArray, along_m: FloatArray, ray_x: FloatArray, ray_y: FloatArray
) -> FloatArray:
    """(n_rays, S) distances along rays to each of segments, inf where they do not meet.

    to_x, to_y: (S,) starts relative to the lidar; along_m: (S, 2) from starts to ends.
    """
    along_x, along_y = along_m[:, 0], along_m[:, 1]
    turn = ray_x[:, None] * along_y - ray_y[:, None] * along_x
    turn = np.where(np.abs(turn) < 1e-12, 1e-12, turn)
    distance = (to_x * along_y - to_y * along_x) / turn
    share = (to_x * ray_y[:, None] - to_y * ray_x[:, None]) / turn
    hit = (distance > 0.0) & (share >= -1e-9) & (share <= 1.0 + 1e-9)
    found: FloatArray = np.where(hit, distance, np.inf)
    return found


class Odometry:
    """Dead reckoning from the start of an episode on, beginning at the true pose."""

    def __init__(self, settings: OdometrySettings, start: Pose, rng: np.random.Generator) -> None:
        self.pose = start
        self._settings, self._rng = settings, rng
        self._last_truth = start
        scale_distance, scale_turn = rng.standard_normal(2)
        self._distance_scale = 1.0 + settings.distance_scale_deviation * scale_distance
        self._turn_scale = 1.0 + settings.turn_scale_deviation * scale_turn

    def follow(self, truth: Pose) -> None:
        """Take the true pose of the next control period, of a robot without wheels."""
        before, self._last_truth = self._last_truth, truth
        if not self._settings.drifts:
            self.pose = truth
            return
        turned = math.remainder(truth[2] - before[2], math.tau)
        heading = before[2] + 0.5 * turned
        moved_x, moved_y = truth[0] - before[0], truth[1] - before[1]
        self.add(moved_x * math.cos(heading) + moved_y * math.sin(heading), turned)

    def add(self, distance: float, turned: float) -> None:
        """Take the motion (m, rad) of the wheels in the next control period."""
        noise = math.sqrt(abs(distance)) * self._rng.standard_normal(2)
        distance = distance * self._distance_scale + self._settings.distance_noise_m * noise[0]
        turned = turned * self._turn_scale + self._settings.turn_noise_rad * noise[1]
        x_m, y_m, yaw_rad = self.pose
        middle = yaw_rad + 0.5 * turned
        self.pose = (
            x_m + distance * math.cos(middle),
            y_m + distance * math.sin(middle),
            math.remainder(yaw_rad + turned, math.tau),
        )
