"""The flow of people per cell as a CSV table beside the table of decisions.

One row per state of the grid, in order: where its centre is, the direction people walk in there
(north, east, south, west or none) and what that was told from.
"""

import csv
import io
from pathlib import Path

import numpy as np

from serd_core.arrays import FloatArray, IntArray
from serd_core.grid.grid import Action, Grid
from serd_core.grid.navigation import NO_FLOW
from storage.atomic import atomic_write_text
from storage.errors import FileError
from storage.nearest import hint
from storage.text_file import read_text

COLUMNS = ("state", "x_m", "y_m", "flow", "order", "count", "vx_mps", "vy_mps")
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
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    names = [_NAMES[each] for each in flow.tolist()]
    columns = grid.centers_m.tolist(), names, order.round(4).tolist(), count.tolist()
    rows = zip(*columns, mean_velocity_mps.round(4).tolist(), strict=True)
    for state, (center, name, sure, seen, velocity) in enumerate(rows):
        writer.writerow((state, *center, name, sure, seen, *velocity))
    atomic_write_text(path, text.getvalue())


def load_flow(path: str | Path, grid: Grid) -> IntArray:
    """(S,) the direction in each state, -1 for none; FileError where it is of another grid."""
    rows = [row for row in csv.reader(read_text(path).splitlines()) if row]
    if not rows or tuple(rows[0]) != COLUMNS:
        found = ",".join(rows[0])[:80] if rows else "an empty file"
        raise FileError(f"{path}: line 1 must be {','.join(COLUMNS)}, got {found}")
    if len(rows) - 1 != grid.n_states:
        raise FileError(
            f"{path}: must have one line for each of the grid's {grid.n_states} states, got"
            f" {len(rows) - 1}; it was made for another grid"
        )
    flow = [_flow_of(f"{path}: line {line}", row) for line, row in enumerate(rows[1:], start=2)]
    centers = np.array([_center_of(f"{path}: line {2 + i}", row) for i, row in enumerate(rows[1:])])
    apart = np.abs(centers - grid.centers_m).max(axis=1) > 1e-6 * grid.cell_size_m
    if apart.any():
        state = int(np.argmax(apart))
        raise FileError(
            f"{path}: line {state + 2} must be the cell at {tuple(grid.centers_m[state].tolist())},"
            f" got {tuple(centers[state].tolist())}; it was made for another grid"
        )
    return np.array(flow, dtype=np.int64)


def _flow_of(where: str, row: list[str]) -> int:
    if len(row) != len(COLUMNS):
        raise FileError(f"{where} must have {len(COLUMNS)} columns, got {len(row)}")
    if row[3] not in _FLOWS:
        fix = hint(row[3], _FLOWS)
        raise FileError(f"{where}, flow must be a direction or none, got {row[3]!r}; {fix}")
    return _FLOWS[row[3]]


def _center_of(where: str, row: list[str]) -> tuple[float, float]:
    try:
        return float(row[1]), float(row[2])
    except ValueError:
        raise FileError(f"{where}, x_m and y_m must be numbers, got {row[1]}, {row[2]}") from None
