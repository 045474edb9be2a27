"""One scan of a lidar with the geometry that its message has."""

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from serd_core.arrays import BoolArray, FloatArray
from sim.safety.motion import Pose

#: Error (m) allowed between the place of a person and the points that show it.
_PLACE_ERROR_M = 0.3
#: People beyond this distance (m) are not looked for in a scan.
_VIEW_M = 5.0


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
        return all(map(math.isfinite, vars(self).values()))

    def angles_rad(self, n_rays: int) -> FloatArray:
        """(n_rays,) directions of the rays in the lidar's frame."""
        rays = np.arange(n_rays, dtype=np.float64)
        return self.angle_min_rad + self.angle_increment_rad * rays


@lru_cache(maxsize=16)
def _directions(geometry: ScanGeometry, n_rays: int) -> FloatArray:
    angle = geometry.angles_rad(n_rays)
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


@dataclass(frozen=True, eq=False)
class Scan:
    """ranges_m: (n_rays,) single precision. mount: pose of the lidar on the robot, None for that
    of the settings."""

    stamp_s: float
    ranges_m: NDArray[np.float32]
    geometry: ScanGeometry
    mount: Pose | None = None

    @cached_property
    def valid(self) -> BoolArray:
        """(n_rays,) which rays have a range; lidars whose range_min is 0 send 0 for none."""
        geometry, ranges_m = self.geometry, self.ranges_m
        above = (ranges_m >= geometry.range_min_m) & (ranges_m > 0.0)
        return above & (ranges_m <= geometry.range_max_m)

    @property
    def angles_rad(self) -> FloatArray:
        """(n_rays,) directions of the rays in the lidar's frame."""
        return self.geometry.angles_rad(len(self.ranges_m))

    @property
    def directions(self) -> FloatArray:
        """(n_rays, 2) directions of the rays in the lidar's frame; do not write to it."""
        return _directions(self.geometry, len(self.ranges_m))

    def points_within(self, range_m: float) -> FloatArray:
        """(N, 2) ends of the rays of up to that range, in the lidar's frame."""
        rays = (self.valid & (self.ranges_m <= range_m)).nonzero()[0]
        return self.ranges_m[rays, None].astype(np.float64) * self.directions[rays]


def shown_by(scan: Scan, place_m: FloatArray, radius_m: float) -> tuple[int, int]:
    """How many people at places (N, 2) in the lidar's frame a scan shows, and how many it does not.

    It does not show a person if all rays near the body go on behind it. Those who are hidden, far
    away, or in no ray that has a range, count as neither.
    """
    geometry = scan.geometry
    away_m = np.hypot(place_m[:, 0], place_m[:, 1])
    reach_m = radius_m + _PLACE_ERROR_M
    in_view = (away_m > reach_m) & (away_m < min(_VIEW_M, geometry.range_max_m))
    away_m, place_m = away_m[in_view, None], place_m[in_view]
    if not len(place_m):
        return 0, 0
    # Rays that meet a circle go along it at least as far as its tangent from the lidar is long.
    along_m = place_m @ scan.directions.T
    near_body = (along_m >= np.sqrt(away_m**2 - reach_m**2)) & scan.valid
    on_body = near_body & (along_m >= np.sqrt(away_m**2 - radius_m**2))
    beyond = np.where(near_body, scan.ranges_m - away_m, np.inf)
    is_ray = on_body.any(axis=1)
    seen = is_ray & (np.abs(beyond) <= reach_m).any(axis=1)
    unseen = is_ray & (beyond > reach_m).all(axis=1)
    return int(seen.sum()), int(unseen.sum())
