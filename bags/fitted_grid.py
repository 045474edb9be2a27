"""A grid for a place nobody has drawn: where the robot has been is walkable, and around it."""

import numpy as np

from bags.errors import BagError
from serd_core.arrays import FloatArray
from serd_core.grid import Grid


def grid_around(position_m: FloatArray, cell_size_m: float, margin_cells: int = 1) -> Grid:
    """Grid whose walkable cells are those of (N, 2) positions and those up to the margin away.

    Cell borders lie on whole multiples of the cell size, so that grids of several bags agree.
    """
    if not len(position_m):
        raise BagError("position_m must hold at least one position to fit a grid, got none")
    if not cell_size_m > 0:
        raise BagError(f"cell_size_m must be above 0, got {cell_size_m}")
    places = np.asarray(position_m, dtype=np.float64)
    low = np.floor(places.min(axis=0) / cell_size_m) - margin_cells
    origin_m = (float(low[0] * cell_size_m), float(low[1] * cell_size_m))
    cells = np.floor((places - origin_m) / cell_size_m).astype(np.int64)
    columns, rows = cells.max(axis=0) + 1 + margin_cells
    walkable = np.zeros((rows, columns), dtype=bool)
    for column, row in np.unique(cells, axis=0):
        walkable[
            row - margin_cells : row + margin_cells + 1,
            column - margin_cells : column + margin_cells + 1,
        ] = True
    return Grid(origin_m, cell_size_m, walkable)
