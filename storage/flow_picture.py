"""The flow of people per cell as a picture in characters, north up, for files people read."""

from collections.abc import Sequence

import numpy as np

from serd_core.arrays import IntArray
from serd_core.grid.grid import Action, Grid
from serd_core.grid.navigation import NO_FLOW

_BLOCKED = "#"
_SIGNS = {
    NO_FLOW: ".",
    int(Action.NORTH): "^",
    int(Action.EAST): ">",
    int(Action.SOUTH): "v",
    int(Action.WEST): "<",
}
_FLOWS = {sign: flow for flow, sign in _SIGNS.items()}


def flow_picture(grid: Grid, flow: IntArray) -> tuple[str, ...]:
    """Rows of `^ > v <`, `.` where there is no flow, `#` where a cell is blocked."""
    signs = np.full(grid.walkable.shape, _BLOCKED)
    signs[grid.walkable] = [_SIGNS[each] for each in flow.tolist()]
    return tuple("".join(row) for row in signs[::-1])


def flow_of_picture(rows: Sequence[str], grid: Grid) -> IntArray | None:
    """(S,) the flow of such rows; None where they are no picture of this grid."""
    height, width = grid.walkable.shape
    if len(rows) != height or any(len(row) != width for row in rows):
        return None
    signs = np.array([list(row) for row in rows[::-1]])
    if not np.array_equal(signs != _BLOCKED, grid.walkable):
        return None
    found = [_FLOWS.get(sign) for sign in signs[grid.walkable].tolist()]
    return None if None in found else np.array(found, dtype=np.int64)
