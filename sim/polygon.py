"""Plane geometry of simple polygons and wall segments.

A polygon is an (n, 2) array of corners in order, closed implicitly. A segment list is (W, 2, 2):
start and end points.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from serd_core.arrays import BoolArray, FloatArray


def edges_of(polygon_m: ArrayLike) -> FloatArray:
    """(n, 2, 2) edges of a polygon, each from a corner to the next."""
    corners = np.asarray(polygon_m, dtype=np.float64)
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


def signed_area_m2(polygon_m: ArrayLike) -> float:
    """Area of a simple polygon, positive when its corners run counter-clockwise."""
    start, end = np.moveaxis(edges_of(polygon_m), 1, 0)
    return float(0.5 * np.sum(start[:, 0] * end[:, 1] - end[:, 0] * start[:, 1]))


def contains(polygon_m: ArrayLike, points_m: ArrayLike) -> BoolArray:
    """(N,) whether each of the (N, 2) points lies inside the polygon (even-odd rule)."""
    points = np.asarray(points_m, dtype=np.float64).reshape(-1, 2)
    start, end = np.moveaxis(edges_of(polygon_m), 1, 0)
    x, y = points[:, 0, None], points[:, 1, None]
    straddles = (start[:, 1] > y) != (end[:, 1] > y)
    rise = np.where(end[:, 1] == start[:, 1], 1.0, end[:, 1] - start[:, 1])
    crossing_x = start[:, 0] + (y - start[:, 1]) * (end[:, 0] - start[:, 0]) / rise
    odd: BoolArray = (np.sum(straddles & (x < crossing_x), axis=1) % 2).astype(np.bool_)
    return odd


def contains_point(polygon_m: Sequence[tuple[float, float]], x_m: float, y_m: float) -> bool:
    """`contains` for one point, without arrays: for every tick."""
    inside = False
    x_before, y_before = polygon_m[-1]
    for x, y in polygon_m:
        if (y_before > y_m) != (y > y_m):
            crossing_x = x_before + (y_m - y_before) * (x - x_before) / (y - y_before)
            inside ^= x_m < crossing_x
        x_before, y_before = x, y
    return inside


def distance_to_segments_m(points_m: ArrayLike, segments_m: FloatArray) -> FloatArray:
    """(N, W) distance of each point to each segment."""
    points = np.asarray(points_m, dtype=np.float64).reshape(-1, 1, 2)
    start, along = segments_m[:, 0], segments_m[:, 1] - segments_m[:, 0]
    length_squared = np.maximum(np.sum(along**2, axis=1), 1e-12)
    share = np.clip(np.sum((points - start) * along, axis=2) / length_squared, 0.0, 1.0)
    nearest = start + share[..., None] * along
    distance: FloatArray = np.linalg.norm(points - nearest, axis=2)
    return distance


def self_intersection(polygon_m: ArrayLike) -> tuple[int, int] | None:
    """Two edges of the polygon that properly cross each other, or None when it is simple."""
    edges = edges_of(polygon_m)
    for first in range(len(edges)):
        for second in range(first + 2, len(edges)):
            if _cross(edges[first], edges[second]):
                return first, second
    return None


def _cross(first: FloatArray, second: FloatArray) -> bool:
    def side(line: FloatArray, point: FloatArray) -> float:
        along, towards = line[1] - line[0], point - line[0]
        return float(np.sign(along[0] * towards[1] - along[1] * towards[0]))

    separated_by_first = side(first, second[0]) * side(first, second[1]) < 0
    separated_by_second = side(second, first[0]) * side(second, first[1]) < 0
    return separated_by_first and separated_by_second
