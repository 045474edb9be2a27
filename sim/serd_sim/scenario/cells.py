"""The square cells of a place that a robot can be in, and how it gets from one to the next.

By default a cell is walkable where the footprint fits: where it holds a part of the free space,
which is the walkable area less what is nearer to a wall than the robot's radius and the margin that
planners keep. Parts of two walkable cells side by side touch, so that no wall lies between them:
where they would not, the cell with the smaller part is left out. So are cells whose part is too
narrow for a robot to enter them, unless the way leads through them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import ArrayLike
from shapely.ops import polylabel

from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_core.grid.grid import DIRECTION_VECTORS, Action, Grid
from serd_sim.scenario.polygon import cell_centers, edges_of, signed_wall_distance_m

#: Margin (m) to walls that planners keep, in cells of 1 m and more; in smaller ones in proportion.
WALL_MARGIN_M = 0.05
#: A robot that stops this near to the middle of a part that is narrower has not entered its cell.
_NARROW_M, _NARROW_CELLS = 0.2, 0.2
#: How far (m) beyond the middle of a part a robot drives to that enters its cell.
_BEYOND_M = 0.15
#: Parts of cells are at least this wide (m), and touch over as much.
_LEAST_M = 0.01
_TOLERANCE_M = 0.005


@dataclass(frozen=True, eq=False)
class WalkableCells:
    """origin_m: lower-left corner of the cells; walkable: (rows, columns), row 0 the lowest y.

    places_m: (S, 5, 2) where a robot drives that enters each walkable cell, row by row, by an
    action: the cell's centre where the robot fits there, else the middle of its free part, and a
    little beyond it, so that it enters the cell.
    """

    origin_m: tuple[float, float]
    cell_size_m: float
    walkable: BoolArray
    places_m: FloatArray

    @property
    def centers_m(self) -> FloatArray:
        """(S, 2) centres of the walkable cells, row by row."""
        return self.grid.centers_m

    @property
    def middles_m(self) -> FloatArray:
        """(S, 2) the places without an action."""
        return self.places_m[:, Action.WAIT]

    @cached_property
    def grid(self) -> Grid:
        """The same as a grid of states."""
        return Grid(self.origin_m, self.cell_size_m, self.walkable)


def cells_with_clearance(
    outline_m: ArrayLike, solids_m: Sequence[ArrayLike], cell_size_m: float, clearance_m: float
) -> WalkableCells:
    """Cells over the bounds of the outline; walkable are those with a centre clear of all walls.

    clearance_m: least distance of a walkable centre. With half a cell no wall, however thin, lies
    between the centres of two walkable cells side by side.
    """
    origin_m, centers_m, shape = _raster(outline_m, cell_size_m)
    distance = signed_wall_distance_m(centers_m, [np.asarray(outline_m, float), *solids_m])
    walkable = distance >= clearance_m
    places_m = np.repeat(centers_m[walkable, None], len(Action), axis=1)
    return WalkableCells(origin_m, cell_size_m, walkable.reshape(shape), places_m)


def cells_for_footprint(
    outline_m: ArrayLike, solids_m: Sequence[ArrayLike], cell_size_m: float, needs_m: float
) -> WalkableCells:
    """Cells over the bounds of the outline; walkable are those in which a footprint fits.

    needs_m: least distance of the robot's centre to walls.
    """
    origin_m, centers_m, shape = _raster(outline_m, cell_size_m)
    parts = _free_parts(free_space(outline_m, solids_m, needs_m), origin_m, shape, cell_size_m)
    walkable = ~shapely.is_empty(parts)
    _leave_out_unjoined(parts, walkable, shape)
    walkable = _without_narrow(parts, walkable.reshape(shape), cell_size_m).ravel()
    places_m = np.repeat(centers_m[:, None], len(Action), axis=1)
    points = shapely.points(centers_m)
    beyond_m = _BEYOND_M + 0.5 * _NARROW_CELLS * cell_size_m
    for cell in np.flatnonzero(walkable & ~shapely.intersects(parts, points)):
        beyond = _middle_of(parts[cell], points[cell]) + beyond_m * DIRECTION_VECTORS
        nearest = shapely.shortest_line(parts[cell], shapely.points(beyond))
        places_m[cell] = shapely.get_coordinates(shapely.get_point(nearest, 0))
    return WalkableCells(origin_m, cell_size_m, walkable.reshape(shape), places_m[walkable])


def free_space(
    outline_m: ArrayLike, solids_m: Sequence[ArrayLike], needs_m: float
) -> shapely.Geometry:
    """The walkable area without what is nearer to a wall, also to one without thickness."""
    rings = [np.asarray(each, dtype=np.float64) for each in (outline_m, *solids_m)]
    area, *solids = (shapely.Polygon(ring).buffer(0.0) for ring in rings)
    walls = shapely.multilinestrings(np.concatenate([edges_of(ring) for ring in rings]))
    return area.difference(shapely.union_all([*solids, walls.buffer(needs_m)]))


def narrowest(
    outline_m: ArrayLike,
    solids_m: Sequence[ArrayLike],
    start: shapely.Geometry,
    goal: shapely.Geometry,
    needs_m: float,
) -> tuple[float, tuple[float, float]] | None:
    """Width (m) and place of the narrowest gap between two areas, None where the robot fits.

    The width is 0, and the place in the start, where no way of any width leads there.
    """

    def ends(distance_m: float) -> tuple[shapely.Geometry, shapely.Geometry] | None:
        """The free pieces that reach the start, and the goal; None where a piece reaches both."""
        pieces = shapely.get_parts(free_space(outline_m, solids_m, distance_m))
        at_start, at_goal = shapely.intersects(pieces, start), shapely.intersects(pieces, goal)
        if (at_start & at_goal).any():
            return None
        return shapely.union_all(pieces[at_start]), shapely.union_all(pieces[at_goal])

    apart = ends(needs_m)
    if apart is None:
        return None
    low_m, high_m = 0.0, needs_m
    while high_m - low_m > 0.001:
        middle_m = 0.5 * (low_m + high_m)
        found = ends(middle_m)
        low_m, high_m, apart = (
            (middle_m, high_m, apart) if found is None else (low_m, middle_m, found)
        )
    gap = shapely.shortest_line(*apart)
    if low_m == 0.0 or gap is None:
        return 0.0, (start.centroid.x, start.centroid.y)
    middle = gap.centroid
    return 2.0 * low_m, (middle.x, middle.y)


def _raster(
    outline_m: ArrayLike, cell_size_m: float
) -> tuple[tuple[float, float], FloatArray, tuple[int, int]]:
    """Lower-left corner, centres of all cells row by row, and (rows, columns)."""
    corners = np.asarray(outline_m, dtype=np.float64)
    low, high = corners.min(axis=0), corners.max(axis=0)
    centers_m, shape = cell_centers(low, high, cell_size_m)
    return (float(low[0]), float(low[1])), centers_m, shape


def _free_parts(
    free: shapely.Geometry,
    origin_m: tuple[float, float],
    shape: tuple[int, int],
    cell_size_m: float,
) -> np.ndarray:
    """(cells,) the largest connected part of the free space in each cell, empty where too small."""
    # Cells side by side have the same border, to the last bit.
    south_m, west_m = (
        low_m + cell_size_m * np.arange(count + 1)
        for low_m, count in zip(origin_m[::-1], shape, strict=True)
    )
    west, south = np.meshgrid(west_m[:-1], south_m[:-1])
    east, north = np.meshgrid(west_m[1:], south_m[1:])
    parts: np.ndarray = shapely.box(*(each.ravel() for each in (west, south, east, north)))
    shapely.prepare(free)
    cut = np.flatnonzero(~shapely.contains_properly(free, parts))
    for cell in cut:
        pieces = shapely.get_parts(shapely.intersection(free, parts[cell]))
        largest = max(pieces, key=shapely.area, default=shapely.Polygon())
        west_m, south_m, east_m, north_m = largest.bounds
        is_wide = largest.geom_type == "Polygon" and (
            min(east_m - west_m, north_m - south_m) >= _LEAST_M
        )
        parts[cell] = largest if is_wide else shapely.Polygon()
    return parts


def _middle_of(part: shapely.Polygon, center: shapely.Point) -> FloatArray:
    """The place nearest to a centre of those that are as far as possible from the part's border."""
    deepest = polylabel(part, _TOLERANCE_M)
    inner = part.buffer(2.0 * _TOLERANCE_M - part.exterior.distance(deepest))
    nearest = shapely.get_point(shapely.shortest_line(inner, center), 0)
    middle = deepest if nearest is None else nearest
    return np.array([middle.x, middle.y])


def _leave_out_unjoined(parts: np.ndarray, walkable: BoolArray, shape: tuple[int, int]) -> None:
    """Clear cells until all that are side by side are joined, those with small parts first."""
    first, second = _side_by_side(walkable.reshape(shape))
    border_m = shapely.length(shapely.intersection(parts[first], parts[second]))
    apart = border_m < _LEAST_M
    pairs: IntArray = np.stack([first[apart], second[apart]], axis=1)
    area_m2 = shapely.area(parts)
    for pair in pairs[np.argsort(area_m2[pairs].min(axis=1), kind="stable")]:
        if walkable[pair].all():
            walkable[pair[np.argmin(area_m2[pair])]] = False


def _without_narrow(parts: np.ndarray, walkable: BoolArray, cell_size_m: float) -> BoolArray:
    """(rows, columns) without cells of narrow parts beside wider ones, but for those that join."""
    bounds = shapely.bounds(parts).reshape(*walkable.shape, 4)
    width_m = np.where(walkable[..., None], bounds[..., 2:] - bounds[..., :2], -1.0)
    beside = np.pad(width_m, ((1, 1), (1, 1), (0, 0)), constant_values=-1.0)
    wider_m = np.maximum(beside[1:-1, 2:, 0], beside[1:-1, :-2, 0])
    higher_m = np.maximum(beside[2:, 1:-1, 1], beside[:-2, 1:-1, 1])
    least_m = _NARROW_M + _NARROW_CELLS * cell_size_m
    # Whole cells are as wide as each other but for rounding.
    beside_m = np.stack([wider_m, higher_m], axis=-1) - _TOLERANCE_M
    is_narrow = (width_m < least_m) & (width_m < beside_m)
    narrow = np.flatnonzero(walkable & is_narrow.any(axis=-1))
    n_groups = len(np.unique(groups_of(walkable)))
    narrowest_first = narrow[np.argsort(width_m.min(axis=-1).flat[narrow], kind="stable")]
    kept = walkable.copy()
    for cells in (narrow, *narrowest_first):
        before = kept.copy()
        kept.flat[cells] = False
        if len(np.unique(groups_of(kept))) != n_groups:
            kept = before
        elif cells is narrow:
            break
    return kept


def groups_of(walkable: BoolArray) -> IntArray:
    """(rows, columns) a number for each group of cells that moves join, 0 for other cells.

    `scipy.ndimage.label` would find them as well, but takes 0.2 s of every node's start to import.
    """
    first, second = _side_by_side(walkable)
    #: For each cell the last one of its group, as far as it is known.
    last = np.arange(walkable.size)
    while len(first):
        np.maximum.at(last, np.minimum(first, second), np.maximum(first, second))
        while not np.array_equal(last, further := last[last]):
            last = further
        first, second = last[first], last[second]
        apart = first != second
        first, second = first[apart], second[apart]
    return np.where(walkable, last.reshape(walkable.shape) + 1, 0)


def _side_by_side(walkable: BoolArray) -> tuple[IntArray, IntArray]:
    """Numbers of both cells of each pair of walkable cells side by side."""
    number = np.arange(walkable.size).reshape(walkable.shape)
    first = np.concatenate([number[:, :-1].ravel(), number[:-1].ravel()])
    second = np.concatenate([number[:, 1:].ravel(), number[1:].ravel()])
    both = walkable.flat[first] & walkable.flat[second]
    return first[both], second[both]
