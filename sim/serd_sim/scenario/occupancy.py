"""The map as a raster: what is free, what is wall, and how far the nearest wall is.

Row 0 is the lowest y and column 0 the lowest x, as in nav_msgs/OccupancyGrid.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from serd_core.arrays import FloatArray
from serd_sim.scenario.polygon import cell_centers, contains, signed_wall_distance_m
from serd_sim.scenario.scenario import Scenario

FREE, OCCUPIED, UNKNOWN = 0, 100, -1
_MARGIN_M = 0.5
_WALL_THICKNESS_M = 0.2


@dataclass(frozen=True, eq=False)
class OccupancyRaster:
    """cells: (rows, columns) int8 from FREE to OCCUPIED, or UNKNOWN; origin_m: lower-left corner,
    about which the raster is turned by yaw_rad."""

    origin_m: tuple[float, float]
    resolution_m: float
    cells: NDArray[np.int8]
    yaw_rad: float = 0.0


@dataclass(frozen=True, eq=False)
class WallDistanceRaster:
    """distance_m: (rows, columns) to the nearest wall, negative outside the walkable area."""

    origin_m: tuple[float, float]
    resolution_m: float
    distance_m: FloatArray

    def at(self, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
        """Distance at points of any shape, between the four raster cells around each."""
        rows, columns = self.distance_m.shape
        scale = 1.0 / self.resolution_m
        right = ((x_m - self.origin_m[0]) * scale - 0.5).clip(0.0, columns - 1.001)
        up = ((y_m - self.origin_m[1]) * scale - 0.5).clip(0.0, rows - 1.001)
        column, row = right.astype(np.intp), up.astype(np.intp)
        right -= column
        up -= row
        row *= columns
        row += column
        flat = self.distance_m.ravel()
        low, high = flat[row], flat[row + columns]
        low += right * (flat[row + 1] - low)
        high += right * (flat[row + columns + 1] - high)
        high -= low
        high *= up
        high += low
        found: FloatArray = high
        return found


def wall_distance_raster(scenario: Scenario, resolution_m: float = 0.05) -> WallDistanceRaster:
    """Distance to the walls at the centre of every raster cell, with a margin outside.

    Computed once for each set of walls and cached; the array is read-only.
    """
    outlines = tuple(
        tuple((float(x), float(y)) for x, y in polygon) for polygon in scenario.wall_polygons_m
    )
    return _wall_distance_raster(outlines, resolution_m)


def occupancy_raster(scenario: Scenario, resolution_m: float = 0.05) -> OccupancyRaster:
    """Free inside the walkable area, occupied in and up to 0.2 m behind walls, unknown beyond."""
    raster = wall_distance_raster(scenario, resolution_m)
    cells = np.full(raster.distance_m.shape, UNKNOWN, dtype=np.int8)
    cells[raster.distance_m > -_WALL_THICKNESS_M] = OCCUPIED
    cells[raster.distance_m > 0.0] = FREE
    points, shape = _raster_points(scenario.wall_polygons_m[0], resolution_m)
    for solid in scenario.wall_polygons_m[1:]:
        cells[contains(solid, points).reshape(shape)] = OCCUPIED
    return OccupancyRaster(raster.origin_m, resolution_m, cells)


@lru_cache(maxsize=16)
def _wall_distance_raster(
    outlines: tuple[tuple[tuple[float, float], ...], ...], resolution_m: float
) -> WallDistanceRaster:
    points, shape = _raster_points(np.array(outlines[0]), resolution_m)
    signed = signed_wall_distance_m(points, outlines).reshape(shape)
    signed.flags.writeable = False
    corner = points[0] - 0.5 * resolution_m
    return WallDistanceRaster((float(corner[0]), float(corner[1])), resolution_m, signed)


def _raster_points(
    outline_m: FloatArray, resolution_m: float
) -> tuple[FloatArray, tuple[int, int]]:
    """(rows * columns, 2) cell centres of the raster around the outline, and (rows, columns)."""
    low, high = outline_m.min(axis=0) - _MARGIN_M, outline_m.max(axis=0) + _MARGIN_M
    return cell_centers(low, high, resolution_m)
