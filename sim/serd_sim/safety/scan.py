"""One scan of a lidar with the geometry that its message has, and what each of its rays states."""

import math
from collections import Counter
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_sim.safety.motion import Pose

#: What a range of 0 states: nothing, no return, or a return nearer than `range_min`.
ZeroIs = Literal["unknown", "free", "obstacle"]
_RANGE_OF_ZERO = {"unknown": np.nan, "free": np.inf, "obstacle": -np.inf}
#: Ranges up to this share of range_max are range_max with noise.
_CLIPPED = 1.01
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
    def is_usable(self) -> bool:
        """Whether all values are numbers, rays differ by a turn at most, and there is a range."""
        has_range = 0.0 <= self.range_min_m < self.range_max_m
        is_finite = all(map(math.isfinite, vars(self).values()))
        return is_finite and has_range and 0.0 < abs(self.angle_increment_rad) <= math.tau

    def angles_rad(self, n_rays: int) -> FloatArray:
        """(n_rays,) directions of the rays in the lidar's frame."""
        rays = np.arange(n_rays, dtype=np.float64)
        return self.angle_min_rad + self.angle_increment_rad * rays

    def closes(self, n_rays: int) -> bool:
        """Whether the first ray follows the last one, as in a full turn."""
        step_rad = abs(self.angle_increment_rad)
        return n_rays * step_rad > math.tau - 1.5 * step_rad

    def rays_towards(self, bearing_rad: FloatArray, n_rays: int) -> IntArray:
        """(N,) indices of the rays nearest to bearings (N,), -1 where the lidar does not look."""
        per_turn = math.tau / abs(self.angle_increment_rad)
        ray = np.rint((bearing_rad - self.angle_min_rad) / self.angle_increment_rad % per_turn)
        ray = np.where(ray >= round(per_turn), 0.0, ray)
        return np.where(ray < n_rays, ray, -1.0).astype(np.int64)


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

    @property
    def is_usable(self) -> bool:
        """Whether there are rays, by a usable geometry, over less than two turns."""
        turn_rad = len(self.ranges_m) * abs(self.geometry.angle_increment_rad)
        return self.geometry.is_usable and 0.0 < turn_rad < 2.0 * math.tau

    @property
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

    def interpreted(self, zero_is: ZeroIs) -> tuple["Scan", BoolArray]:
        """The same scan with a range, inf for a free ray, or NaN for one that states nothing; and
        (n_rays,) which rays are too near.

        By REP 117 -inf is nearer than range_min, as every range below it; it becomes range_min.
        +inf is free up to range_max, as is range_max itself, to which simulators clip. A number
        beyond states nothing: it is of another unit, or a code. zero_is: what 0 states, which
        differs between drivers.

        >>> ranges = np.array([-np.inf, 0.0, 0.05, 2.0, np.inf, np.nan], dtype=np.float32)
        >>> scan = Scan(0.0, ranges, ScanGeometry(0.0, 1.0, 0.1, 5.0))
        >>> scan.interpreted("unknown")[0].ranges_m
        array([0.1, nan, 0.1, 2. , inf, nan], dtype=float32)
        """
        ranges_m = np.where(self.ranges_m == 0.0, _RANGE_OF_ZERO[zero_is], self.ranges_m)
        near = ranges_m < self.geometry.range_min_m
        far = ranges_m >= self.geometry.range_max_m
        beyond = np.isfinite(ranges_m) & (ranges_m > _CLIPPED * self.geometry.range_max_m)
        ranges_m = np.where(far, np.inf, np.where(near, self.geometry.range_min_m, ranges_m))
        ranges_m[beyond] = np.nan
        return replace(self, ranges_m=ranges_m.astype(np.float32)), near

    def dense(self, apart_rad: float) -> "Scan":
        """The same scan with rays no farther apart: each fills the gaps half-way to the next ones.

        Its range there is that of a flat wall that it met and that faces the edge of the gap.

        >>> ranges = np.array([1.0, 2.0], dtype=np.float32)
        >>> dense = Scan(0.0, ranges, ScanGeometry(0.0, 1.0, 0.1, 5.0)).dense(0.6)
        >>> dense.ranges_m.round(2), dense.angles_rad
        (array([0.88, 0.88, 1.76, 1.76], dtype=float32), array([-0.25,  0.25,  0.75,  1.25]))
        """
        geometry = self.geometry
        gap_rad = geometry.angle_increment_rad
        times = math.ceil(abs(gap_rad) / apart_rad)
        if times == 1:
            return self
        first_rad = geometry.angle_min_rad + 0.5 * (gap_rad / times - gap_rad)
        finer = replace(geometry, angle_min_rad=first_rad, angle_increment_rad=gap_rad / times)
        nearest_m = self.ranges_m * np.float32(math.cos(min(0.5 * abs(gap_rad), 1.0)))
        return replace(self, ranges_m=np.repeat(nearest_m, times), geometry=finer)


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


def runs_of(rays: BoolArray, *, closes: bool) -> list[IntArray]:
    """Indices of the rays that are side by side, from the first to the last of each run."""
    chosen = rays.nonzero()[0]
    if not len(chosen):
        return []
    runs = np.split(chosen, np.flatnonzero(np.diff(chosen) > 1) + 1)
    if closes and len(runs) > 1 and runs[0][0] == 0 and runs[-1][-1] == len(rays) - 1:
        runs[0] = np.concatenate([runs.pop(), runs[0]])
    return runs


#: Share of a scan's rays from which zeros count.
_FEWEST = 0.02
#: Share of the zeros on which a meaning must agree.
_AGREE = 0.6
#: Returns beside zeros are far from this share of range_max on, and near up to this distance (m)
#: or twice range_min.
_FAR, _NEAR_M = 0.5, 0.3
_LEAST_RUN = 3
_MEANINGS = {"free": "no return", "obstacle": "too near", "unknown": "nothing"}


class ZeroRanges:
    """Counts the zeros of scans by what stands beside them.

    >>> ranges = np.array([4.0, 0.0, 0.0, 0.0, 4.5, 4.0], dtype=np.float32)
    >>> zeros = ZeroRanges()
    >>> zeros.take(Scan(0.0, ranges, ScanGeometry(0.0, 0.1, 0.1, 5.0)))
    >>> zeros.seems_to_be
    'free'
    """

    def __init__(self) -> None:
        self._n_rays = 0
        self._sends_inf = False
        self._n_by_meaning: Counter[ZeroIs] = Counter()

    def take(self, scan: Scan) -> None:
        """Count a scan as it came."""
        self._n_rays += len(scan.ranges_m)
        zero = scan.ranges_m == 0.0
        self._sends_inf |= bool(np.isposinf(scan.ranges_m).any())
        near_m = max(_NEAR_M, 2.0 * scan.geometry.range_min_m)
        far_m = _FAR * scan.geometry.range_max_m
        for run in runs_of(zero, closes=scan.geometry.closes(len(zero))):
            beside_m = scan.ranges_m[np.array([run[0] - 1, run[-1] + 1]) % len(zero)]
            sides_m = beside_m[np.isfinite(beside_m) & (beside_m > 0.0)]
            meaning: ZeroIs = "unknown"
            if len(sides_m) == 2 and len(run) >= _LEAST_RUN and (sides_m >= far_m).all():
                meaning = "free"
            elif len(sides_m) == 2 and (sides_m <= near_m).all():
                meaning = "obstacle"
            self._n_by_meaning[meaning] += len(run)

    @property
    def share(self) -> float:
        """Share of the rays that are 0."""
        return self._n_by_meaning.total() / max(self._n_rays, 1)

    @property
    def seems_to_be(self) -> ZeroIs | None:
        """What 0 seems to be, None where there are hardly any."""
        if self.share < _FEWEST:
            return None
        meaning, count = self._n_by_meaning.most_common(1)[0]
        if count < _AGREE * self._n_by_meaning.total() or (meaning == "free" and self._sends_inf):
            return "unknown"
        return meaning

    def sentence(self, zero_is: ZeroIs) -> str:
        """What the zeros seem to mean and what to set where `zero_is` differs; empty without."""
        seems = self.seems_to_be
        if seems is None:
            return ""
        found = f"{100.0 * self.share:.0f} % of the ranges are 0"
        text = f"{found}, which seems to mean {_MEANINGS[seems]}"
        if seems == zero_is:
            return text
        return f"{text}; set zero_is to {seems} if the manual of the lidar agrees, it is {zero_is}"
