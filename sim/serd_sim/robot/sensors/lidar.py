"""A 2-D lidar: rays all around the robot against walls, obstacles and people.

A ray meets a wall segment where both parameters of the crossing are in range, and a body's circle
at along - sqrt(r^2 - across^2). Tests compare it with the ray tests of the physics world, which
agree to millimetres.
"""

import numpy as np
from numpy.typing import NDArray

from serd_core.arrays import FloatArray
from serd_sim.scenario.settings import LidarSettings
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
        nearest = range_to_circles(to_x[near], to_y[near], radius_m**2, ray_x, ray_y)
        np.minimum(ranges, nearest, out=ranges)
        if rng is not None and settings.noise_deviation_m > 0:
            ranges = ranges + settings.noise_deviation_m * rng.standard_normal(len(ranges))
        ranges = np.where(ranges > settings.range_max_m, np.inf, ranges)
        return np.where(ranges < settings.range_min_m, -np.inf, ranges).astype(np.float32)


def range_to_lines(
    to_x: FloatArray, to_y: FloatArray, along_m: FloatArray, ray_x: FloatArray, ray_y: FloatArray
) -> FloatArray:
    """(n_rays,) distances along rays to the nearest of segments.

    to_x, to_y: (S,) starts relative to the lidar; along_m: (S, 2) from starts to ends.
    """
    along_x, along_y = along_m[:, 0], along_m[:, 1]
    turn = ray_x[:, None] * along_y - ray_y[:, None] * along_x
    turn = np.where(np.abs(turn) < 1e-12, 1e-12, turn)
    distance = (to_x * along_y - to_y * along_x) / turn
    share = (to_x * ray_y[:, None] - to_y * ray_x[:, None]) / turn
    hit = (distance > 0.0) & (share >= -1e-9) & (share <= 1.0 + 1e-9)
    nearest: FloatArray = np.where(hit, distance, np.inf).min(axis=1, initial=np.inf)
    return nearest


def range_to_circles(
    to_x: FloatArray, to_y: FloatArray, radius_squared: float, ray_x: FloatArray, ray_y: FloatArray
) -> FloatArray:
    """(n_rays,) distances along rays to the nearest of circles; to_x, to_y: (N,) centres."""
    along = ray_x[:, None] * to_x + ray_y[:, None] * to_y
    inside = radius_squared - (to_x * to_x + to_y * to_y - along * along)
    hit = (inside > 0.0) & (along > 0.0)
    distance = np.where(hit, along - np.sqrt(np.maximum(inside, 0.0)), np.inf)
    nearest: FloatArray = distance.min(axis=1, initial=np.inf)
    return nearest
