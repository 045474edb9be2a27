"""The map as a raster: what is free, what is wall, and how far the nearest wall is.

Row 0 is the lowest y and column 0 the lowest x, as in nav_msgs/OccupancyGrid.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from serd_core.arrays import FloatArray
from sim.polygon import contains, distance_to_segments_m
from sim.scenario import Scenario

FREE, OCCUPIED, UNKNOWN = 0, 100, -1


@dataclass(frozen=True, eq=False)
class OccupancyRaster:
    """cells: (rows, columns) int8 of FREE, OCCUPIED, UNKNOWN; origin_m: lower-left corner."""

    origin_m: tuple[float, float]
    resolution_m: float
    cells: NDArray[np.int8]


@dataclass(frozen=True, eq=False)
class WallDistanceRaster:
    """distance_m: (rows, columns) to the nearest wall, negative outside the walkable area."""

    origin_m: tuple[float, float]
    resolution_m: float
    distance_m: FloatArray

    def at(self, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
        """Distance at points of any shape, from the raster cell they fall in."""
        rows, columns = self.distance_m.shape
        scale = 1.0 / self.resolution_m
        column = ((x_m - self.origin_m[0]) * scale).astype(np.intp)
        row = ((y_m - self.origin_m[1]) * scale).astype(np.intp)
        np.clip(column, 0, columns - 1, out=column)
        np.clip(row, 0, rows - 1, out=row)
        row *= columns
        row += column
        found: FloatArray = self.distance_m.ravel().take(row)
        return found


def wall_distance_raster(scenario: Scenario, resolution_m: float = 0.05) -> WallDistanceRaster:
    """Distance to the walls at the centre of every raster cell, with a margin outside."""
    origin, points, shape = _raster_points(scenario, resolution_m)
    distance = np.min(distance_to_segments_m(points, scenario.wall_segments_m), axis=1)
    signed = np.where(_walkable(scenario, points), distance, -distance)
    return WallDistanceRaster(origin, resolution_m, signed.reshape(shape))


def occupancy_raster(scenario: Scenario, resolution_m: float = 0.05) -> OccupancyRaster:
    """Free inside the walkable area, occupied up to 0.2 m behind its walls, unknown beyond."""
    raster = wall_distance_raster(scenario, resolution_m)
    cells = np.full(raster.distance_m.shape, UNKNOWN, dtype=np.int8)
    cells[raster.distance_m > -0.2] = OCCUPIED
    cells[raster.distance_m > 0.0] = FREE
    for obstacle in scenario.obstacles:
        _, points, shape = _raster_points(scenario, resolution_m)
        cells[contains(obstacle.outline_m, points).reshape(shape)] = OCCUPIED
    return OccupancyRaster(raster.origin_m, resolution_m, cells)


def _walkable(scenario: Scenario, points: FloatArray) -> NDArray[np.bool_]:
    walkable = contains(scenario.walkable_area_m, points)
    for obstacle in scenario.obstacles:
        walkable &= ~contains(obstacle.outline_m, points)
    return walkable


def _raster_points(
    scenario: Scenario, resolution_m: float
) -> tuple[tuple[float, float], FloatArray, tuple[int, int]]:
    """Lower-left corner, (rows * columns, 2) cell centres and (rows, columns)."""
    margin = 0.5
    x_min, y_min, x_max, y_max = scenario.bounds_m
    origin = (x_min - margin, y_min - margin)
    columns = int(np.ceil((x_max - x_min + 2 * margin) / resolution_m))
    rows = int(np.ceil((y_max - y_min + 2 * margin) / resolution_m))
    x, y = np.meshgrid(
        origin[0] + (np.arange(columns) + 0.5) * resolution_m,
        origin[1] + (np.arange(rows) + 0.5) * resolution_m,
    )
    return origin, np.stack([x.ravel(), y.ravel()], axis=1), (rows, columns)
