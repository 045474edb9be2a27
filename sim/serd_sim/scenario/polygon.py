"""Plane geometry of simple polygons and wall segments, and the square cells they are cut into.

A polygon is an (n, 2) array of corners in order, closed implicitly. A segment list is (W, 2, 2):
start and end points. Rules that are checked once use shapely; what trajectories depend on is NumPy.
"""

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import ArrayLike

from serd_core.arrays import BoolArray, FloatArray, IntArray

Point = tuple[float, float]
_SMALLEST_AREA_M2 = 1e-9
_MARGIN_M = 1e-3
#: Points of a tile, for all of which the walls are sorted out together that may be the nearest.
_POINTS_OF_A_TILE = 200
#: Sine of a turn below which two edges are one straight wall.
_SMALLEST_TURN = 1e-9
#: Shift (m) that puts points of the lower and left edges of an area into it.
_OUTLINE_M = 1e-9


def edges_of(polygon_m: ArrayLike) -> FloatArray:
    """(n, 2, 2) edges of a polygon, each from a corner to the next."""
    corners = np.asarray(polygon_m, dtype=np.float64)
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


def counter_clockwise(polygon_m: FloatArray) -> FloatArray:
    """The polygon with its corners in counter-clockwise order."""
    return polygon_m if shapely.is_ccw(shapely.linearrings(polygon_m)) else polygon_m[::-1]


def without_straight_corners(polygon_m: FloatArray) -> FloatArray:
    """The polygon without the corners at which it goes straight on, so that edges are whole walls.

    A corner at which it goes straight back stays, a repeated one counts once.
    """
    polygon_m = polygon_m[(polygon_m != np.roll(polygon_m, 1, axis=0)).any(axis=1)]
    before = polygon_m - np.roll(polygon_m, 1, axis=0)
    after = np.roll(polygon_m, -1, axis=0) - polygon_m
    turn = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    onwards = np.sum(before * after, axis=1)
    straight = (np.abs(turn) <= _SMALLEST_TURN * np.abs(onwards)) & (onwards > 0.0)
    corners: FloatArray = polygon_m[~straight]
    return corners


def contains(polygon_m: ArrayLike, points_m: ArrayLike) -> BoolArray:
    """(N,) whether each of the (N, 2) points lies inside the polygon.

    Of its outline the lower and the left edges belong to it, so polygons side by side share none.
    """
    polygon = shapely.Polygon(np.asarray(polygon_m, dtype=np.float64))
    shapely.prepare(polygon)
    x_m, y_m = np.asarray(points_m, dtype=np.float64).reshape(-1, 2).T + _OUTLINE_M
    return np.asarray(shapely.contains_xy(polygon, x_m, y_m), dtype=np.bool_)


def contains_point(polygon_m: Sequence[tuple[float, float]], x_m: float, y_m: float) -> bool:
    """`contains` for one point."""
    return bool(contains(polygon_m, [(x_m, y_m)])[0])


def distance_to_segments_m(points_m: ArrayLike, segments_m: FloatArray) -> FloatArray:
    """(N, W) distance of each point to each segment."""
    points = np.asarray(points_m, dtype=np.float64).reshape(-1, 1, 2)
    start, along = segments_m[:, 0], segments_m[:, 1] - segments_m[:, 0]
    length_squared = np.maximum(np.sum(along**2, axis=1), 1e-12)
    share = np.clip(np.sum((points - start) * along, axis=2) / length_squared, 0.0, 1.0)
    nearest = start + share[..., None] * along
    distance: FloatArray = np.linalg.norm(points - nearest, axis=2)
    return distance


def require_simple(corners: tuple[Point, ...]) -> tuple[Point, ...]:
    """The corners; ValueError where their outline crosses itself or has no area."""
    edges = edges_of(corners)
    crossing = first_crossing(edges, edges)
    if crossing is not None:
        raise ValueError(
            f"must not cross itself, but edges {crossing[0]} and {crossing[1]} do"
            "; list the corners in order around the area"
        )
    for start, end in zip(corners, (*corners[1:], corners[0]), strict=True):
        if start == end:
            raise ValueError(f"must not have a corner twice in a row, got {list(start)} again")
    if shapely.Polygon(corners).area < _SMALLEST_AREA_M2:
        raise ValueError("must bound an area, but the corners are in one line; move one of them")
    return corners


def first_crossing(segments_m: FloatArray, others_m: FloatArray) -> tuple[int, int] | None:
    """Indices of a segment (N, 2, 2) and of another (M, 2, 2) that properly cross, else None."""
    lines, others = shapely.linestrings(segments_m), shapely.linestrings(others_m)
    pairs = np.argwhere(shapely.crosses(lines[:, None], others))
    return (int(pairs[0, 0]), int(pairs[0, 1])) if len(pairs) else None


def overlap(first_m: ArrayLike, second_m: ArrayLike) -> bool:
    """Whether the interiors of two polygons have a point in common."""
    first, second = shapely.Polygon(first_m), shapely.Polygon(second_m)
    return bool(first.intersects(second) and not first.touches(second))


def cell_centers(
    low_m: FloatArray, high_m: FloatArray, cell_size_m: float
) -> tuple[FloatArray, tuple[int, int]]:
    """(rows * columns, 2) centres of the square cells that cover a box, and (rows, columns).

    Row by row from the lower-left corner; row 0 has the lowest y.
    """
    columns, rows = np.ceil((high_m - low_m) / cell_size_m - 1e-9).astype(int)
    x, y = np.meshgrid(
        low_m[0] + (np.arange(columns) + 0.5) * cell_size_m,
        low_m[1] + (np.arange(rows) + 0.5) * cell_size_m,
    )
    return np.stack([x.ravel(), y.ravel()], axis=1), (int(rows), int(columns))


def signed_wall_distance_m(points_m: FloatArray, polygons_m: Sequence[ArrayLike]) -> FloatArray:
    """(N,) distance to the nearest wall, negative outside the walkable area.

    polygons_m: the outline of the walkable area, then the solids inside it.
    """
    walls_m = np.concatenate([edges_of(polygon) for polygon in polygons_m])
    distance = np.empty(len(points_m))
    for rows in _tiles(points_m):
        near = walls_m[_may_be_nearest(points_m[rows], walls_m)]
        distance[rows] = distance_to_segments_m(points_m[rows], near).min(axis=1)
    walkable = contains(polygons_m[0], points_m)
    for solid in polygons_m[1:]:
        walkable &= ~contains(solid, points_m)
    return np.where(walkable, distance, -distance)


def _tiles(points_m: FloatArray) -> list[IntArray]:
    """Rows of the points of each square of a raster over them."""
    low, high = points_m.min(axis=0), points_m.max(axis=0)
    n_tiles = 1 + len(points_m) // _POINTS_OF_A_TILE
    side_m = max(float(np.sqrt(np.prod(high - low) / n_tiles)), float((high - low).max()) / n_tiles)
    columns, rows = np.floor((points_m - low) / max(side_m, _MARGIN_M)).astype(np.int64).T
    tile = rows * (columns.max() + 1) + columns
    order = np.argsort(tile, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(tile[order])) + 1)


def _may_be_nearest(points_m: FloatArray, walls_m: FloatArray) -> BoolArray:
    """(W,) whether a wall may be the nearest one of a point, by their distances to the middle."""
    low, high = points_m.min(axis=0), points_m.max(axis=0)
    away_m = distance_to_segments_m((low + high) / 2, walls_m)[0]
    reach_m = float(np.linalg.norm(high - low)) + _MARGIN_M  # twice that of the farthest point
    return np.asarray(away_m <= away_m.min() + reach_m)
