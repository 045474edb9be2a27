"""Where a robot drives whose waypoint a wall hides: along the shortest way, as far as it sees.

A rollout is too short to find the way round the jamb of a door. The way leads over the cells of the
raster of wall distances, each joined with eight others.
"""

import math
from typing import Any

import numpy as np
import scipy  # loads sparse at its first use

from serd_core.arrays import FloatArray, IntArray
from serd_sim.scenario.occupancy import wall_distance_raster
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.observation import Observation
from serd_sim.world.waypoint import Waypoint

#: Ways lead at most so far (m) past the box around robot and waypoint.
_DETOUR_M = 4.0
#: A waypoint farther away (m) is left as it is.
_FARTHEST_M = 25.0
#: Ways keep this clear (m) of walls beyond what the robot needs, where there is room.
_CLEAR_M, _CLEAR_WEIGHT = 0.1, 3.0
#: Metres away from a near wall for each metre on.
_SLOPE = 0.5
#: The way is followed at least this far (m): nearer to its waypoint a robot stands.
_AHEAD_M = 0.4
#: Of wall distances at corners.
_RASTER_ERROR_M = 0.01
#: Ways are looked along in such steps of raster cells.
_STRIDE = 3
#: Stands for the next cell at the waypoint.
_GOAL = -1
#: Robot and waypoint may be so far (in raster cells) from the nearest one that is free.
_NEAR = 8


class Sight:
    """Of the robot of one scenario, among its walls; people hide nothing."""

    def __init__(self, scenario: Scenario) -> None:
        self._walls = wall_distance_raster(scenario)
        self._needs_m = scenario.needs_m - _RASTER_ERROR_M
        self._ways: tuple[Waypoint, IntArray, IntArray] | None = None

    def aim(self, observation: Observation, waypoint: Waypoint) -> Waypoint:
        """The waypoint, or where the way to it leaves the robot's sight."""
        here, to = np.array(observation.pose[:2]), np.array([waypoint.x_m, waypoint.y_m])
        if math.dist(here, to) > _FARTHEST_M or self._sees(here, to):
            return waypoint
        way_m = self._way_m(here, waypoint)
        for place in way_m[::-_STRIDE]:
            if math.dist(here, place) < _AHEAD_M or self._sees(here, place):
                return Waypoint(*place.tolist())
        return waypoint

    def _sees(self, here: FloatArray, place: FloatArray) -> bool:
        """Whether the robot can drive straight to a place, clear of walls.

        Beside walls that are nearer to one of the ends, the line must lead away from them.
        """
        length_m = math.dist(here, place)
        count = 2 + math.ceil(length_m / self._walls.resolution_m)
        x_m, y_m = (np.linspace(*ends, count) for ends in zip(here, place, strict=True))
        away_m, along_m = self._walls.at(x_m, y_m), np.linspace(0.0, length_m, count)
        least_m = np.minimum(away_m[0] + _SLOPE * along_m, away_m[-1] + _SLOPE * along_m[::-1])
        least_m = np.minimum(least_m, self._needs_m + _CLEAR_M) - _RASTER_ERROR_M
        return bool((away_m >= least_m).all())

    def _way_m(self, here: FloatArray, waypoint: Waypoint) -> FloatArray:
        """(N, 2) places of the shortest way from the robot to the waypoint, empty without one."""
        if self._ways is None or self._ways[0] != waypoint:
            self._ways = waypoint, *self._ways_to(here, np.array([waypoint.x_m, waypoint.y_m]))
        _, low, before = self._ways
        cell = self._cell_of(here) - low
        if not ((cell >= 0) & (cell < before.shape)).all():
            self._ways = None
            return np.zeros((0, 2))
        at = int(np.ravel_multi_index(tuple(_nearest(before >= _GOAL, cell)), before.shape))
        way, following = [at], before.ravel()
        while following[at] >= 0:
            at = int(following[at])
            way.append(at)
        if following[at] < _GOAL:
            return np.zeros((0, 2))
        cells = np.stack(np.unravel_index(way, before.shape), axis=1) + low
        way_m = self._walls.origin_m + (cells[:, ::-1] + 0.5) * self._walls.resolution_m
        return np.asarray(way_m, dtype=np.float64)

    def _cell_of(self, place: FloatArray) -> IntArray:
        """Row and column of the raster under a place."""
        scaled = (place - self._walls.origin_m) / self._walls.resolution_m
        return np.asarray(np.floor(scaled[::-1]), dtype=np.int64)

    def _ways_to(self, here: FloatArray, to: FloatArray) -> tuple[IntArray, IntArray]:
        """First row and column of a window of the raster; (rows, columns) of it the next cell.

        That is `_GOAL` at the waypoint, and less where no way leads.
        """
        ends = np.stack([self._cell_of(here), self._cell_of(to)])
        margin = math.ceil(_DETOUR_M / self._walls.resolution_m)
        low = np.maximum(ends.min(axis=0) - margin, 0)
        high = ends.max(axis=0) + margin + 1
        away_m = self._walls.distance_m[low[0] : high[0], low[1] : high[1]] - self._needs_m
        before = np.full(away_m.shape, _GOAL - 1, dtype=np.int64)
        if (away_m >= 0.0).any():
            goal = _nearest(away_m >= 0.0, ends[1] - low)
            at = int(np.ravel_multi_index(tuple(goal), before.shape))
            _, found = scipy.sparse.csgraph.dijkstra(
                _joined(away_m), directed=False, indices=at, return_predecessors=True
            )
            before.flat[:] = found
            before.flat[at] = _GOAL
        return low, before


def _nearest(free: np.ndarray, cell: IntArray) -> IntArray:
    """Row and column of the free cell nearest to a cell, the cell itself where none is near."""
    cell = np.clip(cell, 0, np.array(free.shape) - 1)
    low = np.maximum(cell - _NEAR, 0)
    around = np.argwhere(free[low[0] : cell[0] + _NEAR + 1, low[1] : cell[1] + _NEAR + 1]) + low
    if not len(around):
        return cell
    nearest: IntArray = around[np.argmin(((around - cell) ** 2).sum(axis=1))]
    return nearest


def _joined(away_m: FloatArray) -> Any:
    """Costs of steps from each free cell to the next ones right, up, and up to either side."""
    free, near = away_m >= 0.0, np.clip(1.0 - away_m / _CLEAR_M, 0.0, 1.0)
    number = np.arange(free.size).reshape(free.shape)
    steps = []
    for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
        height, width = free.shape[0] - down, free.shape[1] - abs(right)
        first = slice(0, height), slice(max(0, -right), max(0, -right) + width)
        second = slice(down, down + height), slice(max(0, right), max(0, right) + width)
        both = free[first] & free[second]
        weight = 1.0 + _CLEAR_WEIGHT * 0.5 * (near[first] + near[second])[both]
        steps.append((math.hypot(down, right) * weight, number[first][both], number[second][both]))
    costs, starts, ends = (np.concatenate(each) for each in zip(*steps, strict=True))
    return scipy.sparse.csr_matrix((costs, (starts, ends)), shape=(free.size, free.size))
