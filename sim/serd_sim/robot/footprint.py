"""The outline of a robot: a disc round its centre, or a polygon as Nav2's `footprint` states it."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import shapely

from serd_bag.errors import FileError
from serd_core.arrays import FloatArray
from serd_files.yaml_config import read_yaml
from serd_sim.scenario.polygon import (
    contains,
    distance_to_segments_m,
    edges_of,
    require_simple,
)

#: A corner is at most this far (m) from the centre; 50 would be centimetres.
_FARTHEST_M = 10.0


def corners_in(text: str) -> tuple[tuple[float, float], ...]:
    """The corners of a footprint in Nav2's format, none where the text is empty or `[]`.

    ValueError where they are no outline.

    >>> corners_in("[[0.3, 0.2], [-0.3, 0.2], [-0.3, -0.2], [0.3, -0.2]]")
    ((0.3, 0.2), (-0.3, 0.2), (-0.3, -0.2), (0.3, -0.2))
    """
    rule = "must be corners as in '[[0.3, 0.2], [-0.3, 0.2], [-0.3, -0.2], [0.3, -0.2]]'"
    try:
        values = read_yaml(text, "footprint") if text.strip() else []
    except FileError:
        values = None
    if not isinstance(values, list) or not all(map(_is_corner, values)):
        raise ValueError(f"{rule}, in m and at most {_FARTHEST_M:g} m from the centre, got {text}")
    if 0 < len(values) < 3:
        raise ValueError(f"{rule}, three or more, got {text}")
    corners = tuple((float(x_m), float(y_m)) for x_m, y_m in values)
    return require_simple(corners) if corners else ()


def outline_text(text: str) -> str:
    """The text; ValueError as of `corners_in`."""
    corners_in(text)
    return text


def _is_corner(value: object) -> bool:
    if not isinstance(value, list) or len(value) != 2:
        return False
    return all(type(each) in (int, float) for each in value) and math.hypot(*value) <= _FARTHEST_M


@dataclass(frozen=True, eq=False)
class Footprint:
    """An outline in the robot's frame.

    corners_m: (n, 2) of a polygon, (0, 2) where it is a disc. radius_m: of the disc, or of the
    circle round the centre that holds the polygon.
    """

    radius_m: float
    corners_m: FloatArray

    @property
    def is_round(self) -> bool:
        """Whether it is a disc, which a turn leaves as it is."""
        return not len(self.corners_m)

    def gap_m(self, points_m: FloatArray) -> FloatArray:
        """(N,) distance of points (N, 2) in the robot's frame from the outline, below 0 inside."""
        if self.is_round:
            gap_m: FloatArray = np.hypot(points_m[:, 0], points_m[:, 1]) - self.radius_m
            return gap_m
        away_m = distance_to_segments_m(points_m, edges_of(self.corners_m)).min(axis=1)
        signed_m: FloatArray = np.where(contains(self.corners_m, points_m), -away_m, away_m)
        return signed_m

    def gaps_m(
        self, poses: FloatArray, points_m: FloatArray, exact_below_m: float = np.inf
    ) -> FloatArray:
        """(T, N) distances of points (N, 2), or (T, N, 2) that move, at poses (T, 3).

        exact_below_m: distances from there on may be smaller than they are, but not below it.
        """
        away_m = points_m - poses[:, None, :2]
        gaps_m: FloatArray = np.hypot(away_m[..., 0], away_m[..., 1]) - self.radius_m
        if self.is_round:
            return gaps_m
        near = gaps_m < exact_below_m
        turned = np.broadcast_to(poses[:, 2, None], near.shape)[near]
        (x_m, y_m), cos, sin = away_m[near].T, np.cos(turned), np.sin(turned)
        gaps_m[near] = self.gap_m(np.stack([cos * x_m + sin * y_m, cos * y_m - sin * x_m], axis=1))
        return gaps_m

    def covers(self, other: "Footprint") -> bool:
        """Whether the other outline is within this one, to a millimetre."""
        return bool((self.gap_m(other.outline_m(0.01)) <= 1e-3).all())

    def outline_m(self, step_m: float) -> FloatArray:
        """(N, 2) points along the outline, at most step_m apart, with all corners."""
        if self.is_round:
            angle = np.linspace(0.0, 2.0 * np.pi, 2 + int(2.0 * np.pi * self.radius_m / step_m))
            points_m: FloatArray = self.radius_m * np.stack([np.cos(angle), np.sin(angle)], axis=1)
            return points_m
        line = shapely.segmentize(shapely.linearrings(self.corners_m), step_m)
        corners_m: FloatArray = shapely.get_coordinates(line)
        return corners_m

    @property
    def inscribed_m(self) -> float:
        """Radius of the largest disc round the centre that is within the outline, 0 without one."""
        return float(np.maximum(-self.gap_m(np.zeros((1, 2))), 0.0)[0])


@lru_cache(maxsize=16)
def footprint_of(radius_m: float, text: str) -> Footprint:
    """The polygon of a text in Nav2's format; the disc where there is none."""
    corners: FloatArray = np.array(corners_in(text), dtype=np.float64).reshape(-1, 2)
    if not len(corners):
        return Footprint(radius_m, corners)
    return Footprint(float(np.hypot(*corners.T).max()), corners)
