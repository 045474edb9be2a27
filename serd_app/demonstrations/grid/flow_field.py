"""In which direction people walk in each cell, from recorded people.

The flow of a cell is the axis nearest to the sum of the velocities seen in it; there is none where
fewer than a number of people were seen, or where they do not walk in one direction: the order
|sum v| / sum |v| is 1 when all walk the same way and 0 when they cancel.

Its table beside that of decisions has a row per state of the grid, in order: the centre of the
cell, the flow (north, east, south, west or none) and the measurements that it was derived from.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import blake2b
from pathlib import Path

import numpy as np

from serd_app.drives.recorded_people import Sighting
from serd_app.drives.recording import Recording
from serd_bag.errors import FileError
from serd_bag.nearest import hint
from serd_core.arrays import FloatArray, IntArray
from serd_core.grid.grid import Action, Grid, action_of_direction
from serd_core.grid.navigation import NO_FLOW
from serd_files.table import Column, read_table, write_table

_LEAST_ORDER = 0.5
_COLUMNS = (
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


@dataclass(frozen=True, eq=False)
class FlowField:
    """flow (S,) an `Action` or -1; mean_velocity_mps (S, 2); order (S,) 0 to 1; count (S,)."""

    flow: IntArray
    mean_velocity_mps: FloatArray
    order: FloatArray
    count: IntArray


def flow_of_people(
    grid: Grid, position_m: FloatArray, velocity_mps: FloatArray, minimum_count: int = 20
) -> FlowField:
    """The flow of people at (N, 2) with velocities (N, 2); those off the grid or not finite are
    left.

    minimum_count: sightings below which a cell has none.
    """
    state = grid.states_at(position_m)
    seen = (state >= 0) & np.isfinite(velocity_mps).all(axis=1)
    state, velocity_mps = state[seen], velocity_mps[seen]
    sum_mps, speed_mps = np.zeros((grid.n_states, 2)), np.zeros(grid.n_states)
    np.add.at(sum_mps, state, velocity_mps)
    np.add.at(speed_mps, state, np.hypot(*velocity_mps.T))
    count = np.bincount(state, minlength=grid.n_states)
    length = np.hypot(*sum_mps.T)
    order = np.divide(length, speed_mps, out=np.zeros_like(length), where=length > 0)
    flow = np.full(grid.n_states, NO_FLOW, dtype=np.int64)
    known = (count >= minimum_count) & (order >= _LEAST_ORDER) & (length > 0)
    for row in np.flatnonzero(known):
        flow[row] = action_of_direction(*(sum_mps[row] / length[row]))
    return FlowField(flow, sum_mps / np.maximum(count, 1)[:, None], order, count)


def flow_from_recordings(
    recordings: Sequence[Recording], sightings: Sequence[Sequence[Sighting]], grid: Grid
) -> FlowField | None:
    """The flow of the people seen in all bags, and of the agents of all tables; None where there
    are none.

    A cloud or table that several of them hold counts once. sightings: of each recording.
    """
    seen: dict[bytes, tuple[FloatArray, FloatArray]] = {}
    for recording, sighted in zip(recordings, sightings, strict=True):
        crowd = recording.crowd
        if crowd is not None and crowd.people:
            digest = blake2b(crowd.position_m.tobytes(), digest_size=16).digest()
            seen.setdefault(digest, (crowd.position_m, crowd.velocity_mps))
        for one in () if crowd else sighted:
            people = one.people.position_m[:, :2], one.people.velocity_mps[:, :2]
            seen.setdefault(one.digest, people)
    if not seen:
        return None
    position_m, velocity_mps = map(np.concatenate, zip(*seen.values(), strict=True))
    return flow_of_people(grid, position_m, velocity_mps)


def save_flow(path: str | Path, grid: Grid, field: FlowField) -> None:
    """Write one line per state."""
    columns = (
        grid.centers_m.tolist(),
        [_NAMES[each] for each in field.flow.tolist()],
        field.order.round(4).tolist(),
        field.count.tolist(),
        field.mean_velocity_mps.round(4).tolist(),
    )
    rows = (
        (state, *center, name, sure, seen, *velocity)
        for state, (center, name, sure, seen, velocity) in enumerate(zip(*columns, strict=True))
    )
    write_table(path, _COLUMNS, rows)


def load_flow(path: str | Path, grid: Grid) -> IntArray:
    """(S,) the direction in each state, -1 for none; FileError where it is of another grid."""
    table = read_table(path, _COLUMNS)
    if len(table) != grid.n_states:
        raise FileError(
            f"{path}: must have one line for each of the grid's {grid.n_states} states, got"
            f" {len(table)}; it was made for another grid"
        )
    for line, name in enumerate((row["flow"] for row in table), start=2):
        if name not in _FLOWS:
            raise FileError(
                f"{path}: line {line}, flow must be a direction or none, got {name!r}"
                f"; {hint(name, _FLOWS)}"
            )
    centers_m = np.array([(row["x_m"], row["y_m"]) for row in table])
    apart = np.abs(centers_m - grid.centers_m).max(axis=1) > 1e-6 * grid.cell_size_m
    if apart.any():
        state = int(np.argmax(apart))
        raise FileError(
            f"{path}: line {state + 2} must be the cell at {tuple(grid.centers_m[state].tolist())},"
            f" got {tuple(centers_m[state].tolist())}; it was made for another grid"
        )
    return np.array([_FLOWS[row["flow"]] for row in table], dtype=np.int64)
