"""Density of people in the cells of a scenario, predicted from how many walk which loop.

People of a loop are taken as spread evenly along it and across its lane, and those who stand as
where they stand. Each counts as a kernel, as in measured densities (`serd_core.grid.density`).
"""

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.grid.density import crowd_shares
from serd_core.grid.grid import Grid
from sim.crowd.routes import offset_loop
from sim.scenario.polygon import edges_of
from sim.scenario.scenario import Scenario
from sim.scenario.settings import Loop

#: Distance of the points that stand for a lane, along and, at most, across.
_SPACING_M = 0.25


def predicted_density(scenario: Scenario, grid: Grid) -> FloatArray:
    """(S,) mean people per m² in each cell."""
    people, loops = scenario.pedestrians, scenario.directed_loops
    standing_m = np.array(people.standing_m, dtype=np.float64).reshape(-1, 2)
    density = crowd_shares(grid.centers_m, standing_m).sum(axis=1)
    total = sum(loop.share for loop in loops)
    for loop in loops if people.count else ():
        points_m = _lane_points_m(loop)
        share = crowd_shares(grid.centers_m, points_m).mean(axis=1)
        density = density + people.count * loop.share / total * share
    return np.asarray(density)


def _lane_points_m(loop: Loop) -> FloatArray:
    """(P, 2) points at equal distances along and across the lane of a loop.

    Each line of the lane counts alike, whatever its length, as people choose lines evenly.
    """
    corners_m, half_m = np.array(loop.waypoints_m), loop.lane_half_width_m
    n_lines = 2 * int(np.ceil(half_m / _SPACING_M)) + 1
    legs = [edges_of(offset_loop(corners_m, offset)) for offset in _middles(n_lines, half_m)]
    n_points = int(np.ceil(np.hypot(*(legs[0][:, 1] - legs[0][:, 0]).T).sum() / _SPACING_M))
    return np.concatenate([_along(each, n_points) for each in legs])


def _middles(count: int, half_m: float) -> FloatArray:
    """(count,) middles of equal parts of the width."""
    return np.asarray(half_m * (2.0 * (np.arange(count) + 0.5) / count - 1.0))


def _along(legs: FloatArray, count: int) -> FloatArray:
    """(count, 2) points at equal distances along a closed line of legs (n, 2, 2)."""
    ends = np.concatenate([[0.0], np.cumsum(np.hypot(*(legs[:, 1] - legs[:, 0]).T))])
    at = (np.arange(count) + 0.5) / count * ends[-1]
    corners = np.concatenate([legs[:, 0], legs[-1:, 1]])
    return np.stack([np.interp(at, ends, column) for column in corners.T], axis=1)
