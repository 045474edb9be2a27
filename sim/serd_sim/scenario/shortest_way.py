"""The shortest way of the robot's centre to the goal area, past walls; people are ignored.

By the visibility graph of the free space, which grows with the square of its corners; in places
with many of them over the cells of a raster, each joined with 16 others.
"""

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
import shapely
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from serd_core.arrays import FloatArray, IntArray
from serd_sim.scenario.occupancy import wall_distance_raster
from serd_sim.scenario.polygon import contains
from serd_sim.scenario.scenario import Scenario
from serd_sim.scenario.settings import Polygon

#: Segments of a quarter circle around a corner; the way is at most 0.1 % too long.
_QUARTER_SEGMENTS = 8
_TOUCHING_M = 1e-6
#: Corners of walls above which the raster is used; its ways are at most 3 % too long.
_MOST_CORNERS = 40
#: Steps (rows, columns) that join a cell of the raster, besides the opposite ones.
_STEPS = ((0, 1), (1, 0), (1, 1), (1, -1), (1, 2), (2, 1), (2, -1), (1, -2))


def shortest_way_m(scenario: Scenario, x_m: float, y_m: float) -> float:
    """Length from a point to the goal area; inf where the robot does not fit through.

    The free space is the walkable area less the obstacles, shrunk by the robot's radius. A point
    nearer to a wall than the radius starts from the nearest free one.
    """
    if len(scenario.wall_segments_m) > _MOST_CORNERS:
        centers_m, of_centers_m = _raster_ways(_place_of(scenario))
        reached = np.isfinite(of_centers_m)
        if not reached.any():
            return float("inf")
        away_m = np.linalg.norm(centers_m[reached] - (x_m, y_m), axis=1)
        return float(of_centers_m[reached][np.argmin(away_m)])
    free, goal, corners_m, to_goal_m = _visibility(_place_of(scenario))
    start = shapely.Point(x_m, y_m)
    if free.is_empty or goal.is_empty:
        return float("inf")
    start = shapely.get_point(shapely.shortest_line(free, start), 0)
    direct = shapely.shortest_line(start, goal)
    ways_m = [shapely.length(direct)] if shapely.covers(free, direct) else []
    if len(corners_m):
        lines = _lines(np.array([[start.x, start.y]]), corners_m)[0]
        seen = shapely.covers(free, lines)
        ways_m += list(shapely.length(lines[seen]) + to_goal_m[seen])
    return float(min(ways_m, default=np.inf))


@dataclass(frozen=True)
class _Place:
    """What a way depends on, as a key; scenario: any one of this place."""

    area_m: Polygon
    solids_m: tuple[Polygon, ...]
    goal_m: Polygon
    radius_m: float
    scenario: Scenario = field(compare=False)


def _place_of(scenario: Scenario) -> _Place:
    area_m, solids_m = scenario.walkable_area_m, tuple(scenario.solids_m)
    return _Place(area_m, solids_m, scenario.goal_area_m, scenario.robot.radius_m, scenario)


@lru_cache(maxsize=32)
def _visibility(place: _Place) -> tuple[shapely.Geometry, shapely.Geometry, FloatArray, FloatArray]:
    """Free space, goal in it, (N, 2) corners of both, (N,) way from each to the goal."""
    outlines = [shapely.Polygon(each) for each in (place.area_m, *place.solids_m)]
    area, *solids = map(_sound, outlines)
    thin = [each.exterior.buffer(_TOUCHING_M) for each in outlines if not each.is_valid]
    room = area.difference(shapely.union_all([*solids, *thin]))
    free = room.buffer(-place.radius_m, quad_segs=_QUARTER_SEGMENTS)
    goal = _sound(shapely.Polygon(place.goal_m)).intersection(free)
    free = free.buffer(_TOUCHING_M, join_style="mitre")
    shapely.prepare(free)
    corners_m = np.concatenate([shapely.get_coordinates(each) for each in (free, goal)])
    if not len(corners_m):
        return free, goal, corners_m, np.zeros(0)
    lines = _lines(corners_m, corners_m)
    length_m = np.where(shapely.covers(free, lines), shapely.length(lines), 0.0)
    last = shapely.shortest_line(shapely.points(corners_m), goal)
    at_goal = np.where(shapely.covers(free, last), shapely.length(last), np.inf)
    between_m = dijkstra(csr_matrix(length_m), directed=False)  # 0 where there is no line
    return free, goal, corners_m, (between_m + at_goal).min(axis=1)


def _sound(outline: shapely.Polygon) -> shapely.Geometry:
    """The area within an outline, which may have walls without thickness."""
    return outline if outline.is_valid else outline.buffer(0.0)


@lru_cache(maxsize=4)
def _raster_ways(place: _Place) -> tuple[FloatArray, FloatArray]:
    """(N, 2) centres of the cells of the raster in which the robot fits, (N,) ways to the goal."""
    walls = wall_distance_raster(place.scenario)
    free = walls.distance_m >= place.radius_m
    number = np.full(free.shape, -1)
    number[free] = np.arange(free.sum())
    cells: FloatArray = np.argwhere(free)[:, ::-1].astype(np.float64) + 0.5
    centers_m = np.array(walls.origin_m) + cells * walls.resolution_m
    links = [_links(number, *step) for step in _STEPS]
    rows, columns, lengths = (np.concatenate(each) for each in zip(*links, strict=True))
    size = (len(centers_m), len(centers_m))
    graph = csr_matrix((lengths * walls.resolution_m, (rows, columns)), shape=size)
    goals = np.flatnonzero(contains(place.goal_m, centers_m))
    if not len(goals):
        return np.zeros((0, 2)), np.zeros(0)
    ways_m = dijkstra(graph, directed=False, indices=goals, min_only=True)
    return np.asarray(centers_m, dtype=np.float64), np.asarray(ways_m)


def _links(number: IntArray, down: int, right: int) -> tuple[IntArray, IntArray, FloatArray]:
    """Numbers of the free cells that a step joins, and its length in cells."""
    rows, columns = number.shape
    left, more = max(0, -right), max(0, right)
    start = number[: rows - down, left : columns - more]
    end = number[down:, left + right : columns - more + right]
    joined = (start >= 0) & (end >= 0)
    return start[joined], end[joined], np.full(int(joined.sum()), np.hypot(down, right))


def _lines(starts_m: FloatArray, ends_m: FloatArray) -> np.ndarray:
    """(M, N) lines between all pairs."""
    pairs = np.broadcast_arrays(starts_m[:, None], ends_m[None])
    lines: np.ndarray = shapely.linestrings(np.stack(pairs, axis=2))
    return lines
