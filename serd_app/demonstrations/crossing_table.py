"""When a robot crossed from cell to cell, as a table: what forecasts of its drives learn from.

Each row is a cell that was left. Its time is counted from the crossing before, in the first cell of
an episode from its start. A crossing is dated where the robot is `HYSTERESIS` of a cell beyond the
border, so that a robot that sways on a border does not cross it again; the arrival is dated to the
end of the episode.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from serd_bag.errors import FileError
from serd_core.arrays import FloatArray, IntArray
from serd_core.arrival.crossing_chain import Kind, direction_of_move
from serd_core.demonstrations.crossings import cell_crossings
from serd_core.demonstrations.decisions import HIDDEN
from serd_core.grid.grid import Grid, Outcome
from serd_core.grid.navigation import MODEL_NAMES, WAITING, model_of_action
from serd_files.table import read_rows

#: Share of a cell beyond its border.
HYSTERESIS = 0.1
#: Outcomes of an action whose cell is left.
FLOWS = MODEL_NAMES[:WAITING]
LEAVING = tuple(outcome.name.lower() for outcome in Outcome if outcome is not Outcome.STAY)
_TOLERANCE_S = 1e-6


@dataclass(frozen=True)
class Crossing:
    """flow: with_flow, against_flow or across_flow; kind: see `Kind`.

    people_pm2: people per m² of walkable area, of all people in the world. action: the last one
    decided before the crossing, `HIDDEN` where that is not known; outcome: the direction of the
    crossing relative to it, empty where it has none; action_flow: flow of that action.
    """

    episode: int
    lookahead_cells: int
    people_pm2: float
    state: int
    next_state: int
    flow: str
    kind: str
    entered_s: float
    dwell_s: float
    action: int
    action_flow: str
    outcome: str


@dataclass(frozen=True, eq=False)
class CrossedPlace:
    """The cells of drives, their flow (S,), and how they were driven."""

    grid: Grid
    flow: IntArray
    lookahead_cells: int
    people_pm2: float


def people_per_m2(grid: Grid, n_people: float) -> float:
    """People per m² of walkable area."""
    return n_people / (grid.n_states * grid.cell_size_m**2)


def crossings_of_track(
    place: CrossedPlace, episode: int, track: FloatArray, decided: FloatArray, *, arrived: bool
) -> list[Crossing]:
    """Of the poses (T, 3) of one episode: increasing times (s), x and y (m).

    decided: (N, 2) ascending times and actions.
    """
    grid, times = place.grid, track[:, 0]
    found = cell_crossings(grid, times, track[:, 1:], HYSTERESIS * grid.cell_size_m)
    if not len(found):
        return []
    state, entered_s = found.state, found.entered_s.copy()
    entered_s[0] = times[0]
    last = grid.state_at(*track[-1, 1:])
    if arrived and last >= 0 and last in grid.neighbours[state[-1]] and last != state[-1]:
        # The goal is entered less far than a crossing needs.
        state, entered_s = np.append(state, last), np.append(entered_s, times[-1])
    direction = direction_of_move(grid, state[:-1], state[1:])
    turning = np.diff(direction, prepend=0) != 0
    flow = place.flow[state[:-1]]
    model = model_of_action(direction, flow)
    before = np.searchsorted(decided[:, 0], entered_s[1:] - _TOLERANCE_S) - 1
    action = np.append(decided[:, 1], HIDDEN).astype(np.int64)[before]
    intended = np.where(action > 0, model_of_action(action, flow), -1)
    turns = np.where(action > 0, (direction - action) % 4 + 1, 0)
    dwell_s = np.diff(entered_s)
    return [
        Crossing(
            episode=episode,
            lookahead_cells=place.lookahead_cells,
            people_pm2=place.people_pm2,
            state=int(state[row]),
            next_state=int(state[row + 1]),
            flow=MODEL_NAMES[model[row]],
            kind=(Kind.FIRST if not row else Kind.TURNING if turning[row] else Kind.STRAIGHT).value,
            entered_s=float(entered_s[row]),
            dwell_s=float(dwell_s[row]),
            action=int(action[row]),
            action_flow=MODEL_NAMES[intended[row]] if intended[row] >= 0 else "",
            outcome=Outcome(int(turns[row])).name.lower() if turns[row] else "",
        )
        for row in range(len(dwell_s))
        if dwell_s[row] > 0 and direction[row] > 0
    ]


def load_crossings(path: str | Path) -> tuple[Crossing, ...]:
    """All rows of a table; FileError names the line of a fault."""
    rows = read_rows(path, Crossing)
    kinds = [kind.value for kind in Kind]
    for line, row in enumerate(rows, start=2):
        for name, value, rule, ok in (
            ("dwell_s", row.dwell_s, "above 0", 0 < row.dwell_s < np.inf),
            ("lookahead_cells", row.lookahead_cells, "at least 1", row.lookahead_cells >= 1),
            ("people_pm2", row.people_pm2, "at least 0", 0 <= row.people_pm2 < np.inf),
            ("kind", row.kind, _one_of(kinds), row.kind in kinds),
            ("flow", row.flow, _one_of(FLOWS), row.flow in FLOWS),
            ("action_flow", row.action_flow, _one_of(FLOWS), row.action_flow in ("", *FLOWS)),
            ("outcome", row.outcome, _one_of(LEAVING), row.outcome in ("", *LEAVING)),
        ):
            if not ok:
                raise FileError(
                    f"{path}: line {line}, {name} must be {rule}, got {value!r}; correct the line"
                )
    return rows


def _one_of(names: Sequence[str]) -> str:
    return f"{', '.join(names[:-1])} or {names[-1]}"
