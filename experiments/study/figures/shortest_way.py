"""The shortest way on foot between two places of a map: along a visibility graph."""

from itertools import combinations

import numpy as np
import scipy.sparse
import scipy.sparse.csgraph

from serd_core.arrays import BoolArray, FloatArray
from sim.scenario.polygon import contains
from sim.scenario.scenario import Scenario

_STEP_M = 0.05


def shortest_way(
    scenario: Scenario, start_m: FloatArray, goal_m: FloatArray, clearance_m: float
) -> FloatArray:
    """(n, 2) corners of the shortest way that keeps a clearance from the outer corners."""
    outline = np.array(scenario.walkable_area_m, dtype=np.float64)
    points = np.array([start_m, goal_m, *_inner_corners(scenario, outline, clearance_m)])
    length = np.zeros((len(points), len(points)))
    for first, second in combinations(range(len(points)), 2):
        if _is_clear(scenario, points[first], points[second]):
            length[first, second] = np.linalg.norm(points[first] - points[second])
    graph = scipy.sparse.csr_array(length)
    _, before = scipy.sparse.csgraph.dijkstra(
        graph, directed=False, indices=0, return_predecessors=True
    )
    way, place = [1], 1
    while place != 0 and before[place] >= 0:
        place = int(before[place])
        way.append(place)
    return points[way[::-1]]


def _inner_corners(scenario: Scenario, outline: FloatArray, clearance_m: float) -> list[FloatArray]:
    """Places diagonally off every corner that are on the floor."""
    offsets = clearance_m * np.array([(1, 1), (1, -1), (-1, 1), (-1, -1)])
    places = (outline[:, None, :] + offsets[None, :, :]).reshape(-1, 2)
    return list(places[_walkable(scenario, places)])


def _is_clear(scenario: Scenario, first: FloatArray, second: FloatArray) -> bool:
    count = max(2, int(np.linalg.norm(second - first) / _STEP_M))
    between = first + np.linspace(0.0, 1.0, count)[:, None] * (second - first)
    return bool(_walkable(scenario, between).all())


def _walkable(scenario: Scenario, points: FloatArray) -> BoolArray:
    inside = contains(scenario.walkable_area_m, points)
    for obstacle in scenario.wall_polygons_m[1:]:
        inside = inside & ~contains(obstacle, points)
    return inside
