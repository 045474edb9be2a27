"""How far the cells of a grid are from what blocks them, where no plan of the walls is known."""

import numpy as np

from serd_core.arrays import BoolArray, FloatArray
from serd_core.grid.grid import Grid


def grid_wall_distance_m(grid: Grid) -> FloatArray:
    """(S,) metres from each cell's centre to the nearest blocked cell; outside is blocked."""
    distance = np.full(grid.n_states, np.inf)
    for blocked in _facing_cells(grid.walkable):
        gap = np.maximum(np.abs(grid.cells - blocked) - 0.5, 0.0)
        distance = np.minimum(distance, np.hypot(gap[:, 0], gap[:, 1]))
    return np.asarray(distance * grid.cell_size_m)


def _facing_cells(walkable: BoolArray) -> FloatArray:
    """(B, 2) row and column of the blocked cells next to a walkable one, corners included."""
    free = np.pad(walkable, 2)
    near = np.zeros_like(free)
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            near |= np.roll(free, (down, right), axis=(0, 1))
    return np.asarray(np.argwhere(near & ~free) - 2.0)
