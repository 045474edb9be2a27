"""The flow of people per cell as a CSV table beside the table of decisions.

One row per state of the grid, in order: the centre of its cell, the direction people walk in there
(north, east, south, west or none) and the measurements that direction was derived from.
"""

from pathlib import Path

import numpy as np

from serd_core.arrays import FloatArray, IntArray
from serd_core.grid.grid import Action, Grid
from serd_core.grid.navigation import NO_FLOW
from storage.errors import FileError
from storage.nearest import hint
from storage.table import Column, read_table, write_table

COLUMNS = (
    Column("state", int),
    Column("x_m", float),
    Column("y_m", float),
    Column("flow", str),
    Column("order", float),
    Column("count", int),
    Column("vx_mps", float),
    Column("vy_mps", float),
)
_FLOWS = {"none": NO_FLOW} | {action.name.lower(): int(action) for action in list(Action)[1:]}
_NAMES = {flow: name for name, flow in _FLOWS.items()}


def save_flow(
    path: str | Path,
    grid: Grid,
    *,
    flow: IntArray,
    order: FloatArray,
    count: IntArray,
    mean_velocity_mps: FloatArray,
) -> None:
    """Write one line per state; flow, order, count (S,), mean_velocity_mps (S, 2)."""
    names = [_NAMES[each] for each in flow.tolist()]
    columns = grid.centers_m.tolist(), names, order.round(4).tolist(), count.tolist()
    rows = zip(*columns, mean_velocity_mps.round(4).tolist(), strict=True)
    write_table(
        path,
        COLUMNS,
        (
            (state, *center, name, sure, seen, *velocity)
            for state, (center, name, sure, seen, velocity) in enumerate(rows)
        ),
    )


def load_flow(path: str | Path, grid: Grid) -> IntArray:
    """(S,) the direction in each state, -1 for none; FileError where it is of another grid."""
    table = read_table(path, COLUMNS)
    if len(table) != grid.n_states:
        raise FileError(
            f"{path}: must have one line for each of the grid's {grid.n_states} states, got"
            f" {len(table)}; it was made for another grid"
        )
    for line, name in enumerate(table["flow"], start=2):
        if name not in _FLOWS:
            raise FileError(
                f"{path}: line {line}, flow must be a direction or none, got {name!r}"
                f"; {hint(name, _FLOWS)}"
            )
    _require_centers(path, table[["x_m", "y_m"]].to_numpy(), grid)
    return np.array([_FLOWS[name] for name in table["flow"]], dtype=np.int64)


def _require_centers(path: str | Path, centers_m: FloatArray, grid: Grid) -> None:
    apart = np.abs(centers_m - grid.centers_m).max(axis=1) > 1e-6 * grid.cell_size_m
    if apart.any():
        state = int(np.argmax(apart))
        raise FileError(
            f"{path}: line {state + 2} must be the cell at {tuple(grid.centers_m[state].tolist())},"
            f" got {tuple(centers_m[state].tolist())}; it was made for another grid"
        )
