"""Plane geometry of simple polygons and wall segments.

A polygon is an (n, 2) array of corners in order, closed implicitly. A segment list is (W, 2, 2):
start and end points.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from serd_core.arrays import BoolArray, FloatArray

Point = tuple[float, float]
_SMALLEST_AREA_M2 = 1e-9
#: Sine of a turn below which two edges are one straight wall.
_SMALLEST_TURN = 1e-9


def edges_of(polygon_m: ArrayLike) -> FloatArray:
    """(n, 2, 2) edges of a polygon, each from a corner to the next."""
    corners = np.asarray(polygon_m, dtype=np.float64)
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


def signed_area_m2(polygon_m: ArrayLike) -> float:
    """Area of a simple polygon, positive when its corners run counter-clockwise."""
    start, end = np.moveaxis(edges_of(polygon_m), 1, 0)
    return float(0.5 * np.sum(start[:, 0] * end[:, 1] - end[:, 0] * start[:, 1]))


def without_straight_corners(polygon_m: FloatArray) -> FloatArray:
    """The same polygon with the corners only at which it turns, so that every edge is a whole wall.

    A corner at which it goes straight back stays.
    """
    before = polygon_m - np.roll(polygon_m, 1, axis=0)
    after = np.roll(polygon_m, -1, axis=0) - polygon_m
    turn = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    onwards = np.sum(before * after, axis=1)
    straight = (np.abs(turn) <= _SMALLEST_TURN * np.abs(onwards)) & (onwards > 0.0)
    corners: FloatArray = polygon_m[~straight]
    return corners


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
    return first_crossing(edges, edges)


def require_simple(corners: tuple[Point, ...]) -> tuple[Point, ...]:
    """The corners; ValueError where their outline crosses itself or has no area."""
    crossing = self_intersection(corners)
    if crossing is not None:
        raise ValueError(
            f"must not cross itself, but edges {crossing[0]} and {crossing[1]} do"
            "; list the corners in order around the area"
        )
    for start, end in zip(corners, (*corners[1:], corners[0]), strict=True):
        if start == end:
            raise ValueError(f"must not have a corner twice in a row, got {list(start)} again")
    if abs(signed_area_m2(corners)) < _SMALLEST_AREA_M2:
        raise ValueError("must bound an area, but the corners are in one line; move one of them")
    return corners


def first_crossing(segments_m: FloatArray, others_m: FloatArray) -> tuple[int, int] | None:
    """Numbers of a segment (N, 2, 2) and of another (M, 2, 2) that properly cross, else None."""
    crossing = _separated(segments_m, others_m) & _separated(others_m, segments_m).T
    pairs = np.argwhere(crossing)
    return (int(pairs[0, 0]), int(pairs[0, 1])) if len(pairs) else None


def overlap(first_m: ArrayLike, second_m: ArrayLike) -> bool:
    """Whether two polygons have a point in common: a corner in the other one, or crossing edges."""
    corner_inside = contains(first_m, second_m).any() or contains(second_m, first_m).any()
    return bool(corner_inside or first_crossing(edges_of(first_m), edges_of(second_m)) is not None)


def _separated(lines_m: FloatArray, segments_m: FloatArray) -> BoolArray:
    """(N, M) whether line n has the two ends of segment m on different sides."""
    start, along = lines_m[:, 0], lines_m[:, 1] - lines_m[:, 0]
    towards = segments_m[None] - start[:, None, None]
    side = np.sign(
        along[:, None, None, 0] * towards[..., 1] - along[:, None, None, 1] * towards[..., 0]
    )
    apart: BoolArray = side[..., 0] * side[..., 1] < 0
    return apart
