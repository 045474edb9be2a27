"""The square cells a walkable area is cut into: a cell counts when its centre is walkable.

A centre on a wall, or nearer to one than the clearance, does not count: a robot cannot stand
there, and its feature 1 / distance would outweigh that of every other cell. With a clearance of
half a cell no wall, however thin, lies between the centres of two walkable cells side by side.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from serd_core.arrays import BoolArray, FloatArray
from serd_sim.scenario.polygon import cell_centers, signed_wall_distance_m

#: Least distance of a walkable cell's centre to the walls by default, as a share of its side.
CLEAR_OF_WALLS = 0.1


@dataclass(frozen=True, eq=False)
class WalkableCells:
    """origin_m: lower-left corner of the cells; walkable: (rows, columns), row 0 the lowest y."""

    origin_m: tuple[float, float]
    cell_size_m: float
    walkable: BoolArray

    @property
    def centers_m(self) -> FloatArray:
        """(S, 2) centres of the walkable cells, row by row."""
        row_column = np.argwhere(self.walkable)
        centers: FloatArray = np.array(self.origin_m) + (row_column[:, ::-1] + 0.5) * (
            self.cell_size_m
        )
        return centers


def walkable_cells(
    outline_m: ArrayLike,
    solids_m: Sequence[ArrayLike],
    cell_size_m: float,
    clearance_m: float | None = None,
) -> WalkableCells:
    """Cells over the bounds of the outline; walkable are those with a centre clear of all walls.

    clearance_m: least distance of a walkable centre; None for a tenth of a cell.
    """
    least_m = CLEAR_OF_WALLS * cell_size_m if clearance_m is None else clearance_m
    corners = np.asarray(outline_m, dtype=np.float64)
    low, high = corners.min(axis=0), corners.max(axis=0)
    centers, shape = cell_centers(low, high, cell_size_m)
    distance = signed_wall_distance_m(centers, [corners, *solids_m])
    walkable = distance >= least_m
    return WalkableCells((float(low[0]), float(low[1])), cell_size_m, walkable.reshape(shape))
