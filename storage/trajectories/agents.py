"""Rows that no column of ids divides, where they are of several agents: by which column they are.

Of several agents, the place jumps away and one of the next rows is near again.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from serd_core.arrays import FloatArray, IntArray
from storage.errors import FileError
from storage.trajectories.cells import Cells
from storage.trajectories.columns import Columns

if TYPE_CHECKING:
    import pandas as pd

#: Share of different times below which rows are of several agents.
_FEW_REPEATED = 0.9
#: Share of jumps above which they are.
_MANY_JUMPS = 0.2
#: A jump is longer than so many distances to the nearest of the next rows.
_FAR = 5.0
_LEAST_ROWS_ON = 8
_MOST_ROWS = 20_000
#: Of the steps without ids: those along the ids of agents are shorter.
_SHORTER = 1 / 3


def with_agents(
    path: Path, cells: Cells, time: FloatArray, place: FloatArray, columns: Columns
) -> Columns:
    """The same with the column along which steps are shortest as the agent, where there are
    several; FileError where no column divides them. time (R,), place (R, 2)."""
    good = np.flatnonzero(np.isfinite(time) & np.isfinite(place).all(axis=1))
    rows = good[np.argsort(time[good], kind="stable")][:_MOST_ROWS]
    if columns.agent >= 0 or not len(rows):
        return columns
    time, place = time[rows], place[rows]
    share_different = len(np.unique(time)) / len(time)
    jumps = _jumps(place, share_different)
    if share_different > _FEW_REPEATED and jumps <= _MANY_JUMPS:
        return columns
    longest = np.inf if jumps <= _MANY_JUMPS else _SHORTER * _usual_step(place, np.zeros_like(rows))
    steps = {each: _usual_step(place, ids) for each, ids in _ids(cells.frame, rows, columns)}
    agent = min(steps, key=steps.__getitem__, default=-1)
    if agent >= 0 and steps[agent] < longest:
        name = cells.names[agent] if cells.names else str(agent + 1)
        assumed = f"the column {name} is taken as the agent"
        return replace(columns, agent=agent, assumed=(*columns.assumed, assumed))
    if jumps <= _MANY_JUMPS:
        return columns
    raise FileError(
        f"{path} must have a column of ids where rows are of several agents: in"
        f" {100 * jumps:.0f} % of the steps the place jumps away and comes back, and no other"
        " column divides the rows into agents; add one, named id, or give each agent as a file"
    )


def _jumps(place: FloatArray, share_different: float) -> float:
    """Share of the steps that lead farther away than the nearest of the next places is."""
    rows_on = min(max(_LEAST_ROWS_ON, round(2 / share_different)), 200)
    count = len(place) - rows_on
    if count < 1:
        return 0.0
    away = (place[on : count + on] - place[:count] for on in range(1, rows_on + 1))
    step, *later = (np.hypot(*each.T) for each in away)
    back = np.min(later, axis=0)
    changes = np.abs(np.diff(place, axis=0))
    smallest = changes[changes > 0].min(initial=np.inf)
    return float(np.mean(step > _FAR * np.maximum(back, max(np.median(back), smallest))))


def _ids(frame: "pd.DataFrame", rows: IntArray, columns: Columns) -> Iterator[tuple[int, IntArray]]:
    """(column, ids of the rows) of whole numbers and texts that come more than once."""
    import pandas as pd

    for each in set(range(frame.shape[1])) - {columns.time, columns.x, columns.y}:
        cells = frame.iloc[rows, each]
        numbers = pd.to_numeric(cells, errors="coerce")
        if bool((numbers.dropna() % 1 == 0).all()):
            ids, names = pd.factorize(cells)
            if len(names) <= len(rows) / 2:
                yield each, ids.astype(np.int64)


def _usual_step(place: FloatArray, ids: IntArray) -> float:
    """Median distance from row to row of one agent; infinite where there are no two."""
    order = np.argsort(ids, kind="stable")
    same = (np.diff(ids[order]) == 0) & (ids[order[1:]] >= 0)
    steps = np.hypot(*np.diff(place[order], axis=0)[same].T)
    return float(np.median(steps)) if len(steps) else np.inf
