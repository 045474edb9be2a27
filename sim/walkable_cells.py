"""The square cells a walkable area is cut into: a cell counts when its centre is walkable."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from serd_core.arrays import BoolArray, FloatArray
from sim.polygon import contains


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
    outline_m: ArrayLike, solids_m: Sequence[ArrayLike], cell_size_m: float
) -> WalkableCells:
    """Cells over the bounds of the outline; those whose centre is in a solid are not walkable."""
    corners = np.asarray(outline_m, dtype=np.float64)
    low, high = corners.min(axis=0), corners.max(axis=0)
    columns, rows = np.ceil((high - low) / cell_size_m - 1e-9).astype(int)
    x, y = np.meshgrid(
        low[0] + (np.arange(columns) + 0.5) * cell_size_m,
        low[1] + (np.arange(rows) + 0.5) * cell_size_m,
    )
    centers = np.stack([x.ravel(), y.ravel()], axis=1)
    walkable = contains(corners, centers)
    for solid in solids_m:
        walkable &= ~contains(solid, centers)
    return WalkableCells(
        (float(low[0]), float(low[1])), cell_size_m, walkable.reshape(int(rows), int(columns))
    )
