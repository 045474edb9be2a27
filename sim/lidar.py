"""A 2-D lidar by ray tests in the physics world."""

import numpy as np
from numpy.typing import NDArray

from serd_core.arrays import FloatArray
from sim.physics import Physics
from sim.settings import LidarSettings


class Lidar:
    """Casts a fan of rays all around the robot at one height."""

    def __init__(self, settings: LidarSettings, height_m: float) -> None:
        self._settings = settings
        self._height_m = height_m
        self.angles_rad: FloatArray = settings.angle_min_rad + settings.angle_increment_rad * (
            np.arange(settings.n_rays, dtype=np.float64)
        )

    def scan(self, physics: Physics, pose: tuple[float, float, float]) -> NDArray[np.float32]:
        """(n_rays,) distance along each ray from the robot's centre; inf where nothing is hit."""
        x_m, y_m, yaw_rad = pose
        directions = np.stack(
            [np.cos(self.angles_rad + yaw_rad), np.sin(self.angles_rad + yaw_rad)], axis=1
        )
        near, far = self._settings.range_min_m, self._settings.range_max_m
        start, end = np.full((2, len(directions), 3), self._height_m)
        start[:, :2] = (x_m, y_m) + near * directions
        end[:, :2] = (x_m, y_m) + far * directions
        share = physics.cast_rays(start, end)
        ranges = np.where(share < 1.0, near + share * (far - near), np.inf)
        return ranges.astype(np.float32)
