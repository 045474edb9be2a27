"""One scan of a lidar with the geometry that its message has."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from serd_core.arrays import BoolArray, FloatArray


@dataclass(frozen=True)
class ScanGeometry:
    """Angle of the first ray, angle between rays, and the ranges that are valid.

    All are rounded to single precision, as sensor_msgs/LaserScan carries them.
    """

    angle_min_rad: float
    angle_increment_rad: float
    range_min_m: float
    range_max_m: float

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            object.__setattr__(self, name, float(np.float32(value)))

    @property
    def is_finite(self) -> bool:
        """Whether all values are numbers."""
        return bool(np.isfinite(list(vars(self).values())).all())


@dataclass(frozen=True, eq=False)
class Scan:
    """ranges_m: (n_rays,) single precision."""

    stamp_s: float
    ranges_m: NDArray[np.float32]
    geometry: ScanGeometry

    @cached_property
    def valid(self) -> BoolArray:
        """(n_rays,) which rays have a range."""
        geometry = self.geometry
        return (self.ranges_m >= geometry.range_min_m) & (self.ranges_m <= geometry.range_max_m)

    def points_within(self, range_m: float) -> FloatArray:
        """(N, 2) ends of the rays of up to that range, in the lidar's frame."""
        rays = np.flatnonzero(self.valid & (self.ranges_m <= range_m))
        angle = self.geometry.angle_min_rad + self.geometry.angle_increment_rad * rays
        reach_m = self.ranges_m[rays].astype(np.float64)
        return np.stack([reach_m * np.cos(angle), reach_m * np.sin(angle)], axis=1)
