"""Pictures of a grid in characters, north up, for files that people read and edit."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from serd_core.arrays import BoolArray, IntArray
from serd_core.grid.grid import Action, Grid
from serd_core.grid.navigation import NO_FLOW

WALKABLE, BLOCKED = ".", "#"
#: Of no flow, north, east, south and west.
_FLOW_SIGNS = ".^>v<"


def walkable_picture(grid: Grid) -> tuple[str, ...]:
    """Rows of `.` where a cell is walkable and `#` where it is blocked."""
    return _rows(np.where(grid.walkable, WALKABLE, BLOCKED))


def walkable_of_picture(rows: Sequence[str]) -> BoolArray:
    """(H, W) the walkable cells, the southernmost row first; rows must have the same length."""
    return np.asarray(_signs(rows) == WALKABLE)


def flow_picture(grid: Grid, flow: IntArray) -> tuple[str, ...]:
    """Rows of `^ > v <`, `.` where there is no flow, `#` where a cell is blocked."""
    signs = np.full(grid.walkable.shape, BLOCKED)
    signs[grid.walkable] = [_FLOW_SIGNS[max(each, Action.WAIT)] for each in flow.tolist()]
    return _rows(signs)


def flow_of_picture(rows: Sequence[str], grid: Grid) -> IntArray | None:
    """(S,) the flow of such rows; None where they are not a picture of this grid."""
    height, width = grid.walkable.shape
    if len(rows) != height or any(len(row) != width for row in rows):
        return None
    signs = _signs(rows)
    if not np.array_equal(signs != BLOCKED, grid.walkable):
        return None
    found = np.array([_FLOW_SIGNS.find(sign) for sign in signs[grid.walkable].tolist()])
    return None if (found < 0).any() else np.where(found == Action.WAIT, NO_FLOW, found)


def _rows(signs: NDArray[np.str_]) -> tuple[str, ...]:
    return tuple("".join(row) for row in signs[::-1])


def _signs(rows: Sequence[str]) -> NDArray[np.str_]:
    return np.array([list(row) for row in rows[::-1]])
