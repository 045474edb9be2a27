"""How rows of a table divide into episodes and agents.

Episodes in which ids and times restart are those of a column, or begin where times go back. Rows
that no column of ids divides, where they are of several agents: of these the place jumps away and
one of the next rows is near again.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from serd_bag.errors import FileError
from serd_core.arrays import FloatArray, IntArray
from serd_files.trajectories.cells import Cells
from serd_files.trajectories.columns import Columns

if TYPE_CHECKING:
    import pandas as pd


#: Fewest rows per episode; a column with more values than that does not number episodes.
_FEWEST_ROWS = 5
#: Share of repeated times above which an episode has several agents.
_FEW_REPEATED = 0.01
#: Smallest share of an episode by which time goes back where the next one begins.
_BACK = 0.5
#: Pause put between episodes whose times overlap, so that agents of one are not seen in another.
_APART_S = 100.0
#: Share of different times below which rows are of several agents.
_MOSTLY_DIFFERENT = 0.9
#: Share of jumps above which they are.
_MANY_JUMPS = 0.2
#: A jump is longer than so many distances to the nearest of the next rows.
_FAR = 5.0
_LEAST_ROWS_ON = 8
_MOST_ROWS = 20_000
#: Of the steps without ids: those along the ids of agents are shorter.
_SHORTER = 1 / 3


def episodes_of(cells: Cells, time: FloatArray, columns: Columns) -> tuple[IntArray, Columns]:
    """(R,) number of the episode of each row, all 0 where there is one.

    Where each episode has a single agent, the column of episodes becomes that of agents. time (R,).
    """
    import pandas as pd

    none = np.zeros(len(time), dtype=np.int64)
    if columns.episode < 0:
        return restarts(time) if columns.agent < 0 <= columns.time else none, columns
    numbers, names = pd.factorize(cells.frame.iloc[:, columns.episode], sort=True)
    episode = numbers.astype(np.int64)
    if not 1 < len(names) <= max(len(time) / _FEWEST_ROWS, 1):
        return none, replace(columns, episode=-1)
    if columns.agent < 0:
        known = np.isfinite(time)
        n_different = len(set(zip(episode[known].tolist(), time[known].tolist(), strict=True)))
        if n_different >= (1 - _FEW_REPEATED) * known.sum():
            columns = replace(columns, agent=columns.episode, episode=-1)
    return episode, columns


def restarts(time: FloatArray) -> IntArray:
    """(R,) number of the episode of each row without ids, counted where the time (R,) goes back.

    All 0 where it never goes back near to the start of the episode before.
    """
    episode = np.zeros(len(time), dtype=np.int64)
    back = np.flatnonzero(np.diff(time) < 0) + 1
    if not len(back) or len(time) < _FEWEST_ROWS * (len(back) + 1):
        return episode
    begins = np.concatenate([[0], back])
    elapsed = time[back - 1] - time[begins[:-1]]
    if (time[back - 1] - time[back] < _BACK * elapsed).any():
        return episode
    episode[back] = 1
    return np.cumsum(episode)


def agents_of_episodes(
    cells: Cells, columns: Columns, agent: IntArray, ids: list[str], episode: IntArray
) -> tuple[IntArray, list[str], list[str]]:
    """(R,) number of the agent of each episode, their names, and their ids in the table."""
    is_agent = columns.agent >= 0 and columns.episode < 0
    if is_agent or not episode.any():
        return agent, ids, ids
    known = (agent >= 0) & (episode >= 0)
    keys, found = np.unique(
        np.stack([agent[known], episode[known]], axis=1), axis=0, return_inverse=True
    )
    numbers = np.full(len(agent), -1, dtype=np.int64)
    numbers[known] = found.ravel()
    word, labels = "episode", [str(each + 1) for each in range(int(episode.max()) + 1)]
    if columns.episode >= 0:
        given = cells.frame.iloc[:, columns.episode]
        word = cells.names[columns.episode] if cells.names else word
        first = {number: row for row, number in reversed(list(enumerate(episode.tolist())))}
        labels = [str(given.iloc[first[each]]) for each in range(len(labels))]
    of_keys = [ids[each] for each in keys[:, 0]]
    if columns.agent < 0:
        return numbers, [labels[each] for each in keys[:, 1]], of_keys
    names = [
        f"{name} of {word} {labels[each]}" for name, each in zip(of_keys, keys[:, 1], strict=True)
    ]
    return numbers, names, of_keys


def on_one_clock(time_s: FloatArray, episode: IntArray) -> tuple[FloatArray, tuple[str, ...]]:
    """(N,) times without overlaps of the episodes (N,), and a sentence where there were some."""
    if not episode.any():
        return time_s, ()
    count = int(episode.max()) + 1
    begin_s, end_s = np.full(count, np.inf), np.full(count, -np.inf)
    np.minimum.at(begin_s, episode, time_s)
    np.maximum.at(end_s, episode, time_s)
    there = np.flatnonzero(np.isfinite(begin_s))
    order = there[np.argsort(begin_s[there], kind="stable")]
    if (begin_s[order[1:]] > end_s[order[:-1]]).all():
        return time_s, ()
    shift_s = np.zeros(count)
    last_s = np.cumsum(end_s[there] - begin_s[there] + _APART_S)
    shift_s[there] = np.concatenate([[0.0], last_s[:-1]]) - begin_s[there] + begin_s[there[0]]
    sentence = f"times of {len(there)} episodes overlap, so each has a clock of its own"
    return time_s + shift_s[episode], (sentence,)


def with_agents(
    path: Path, cells: Cells, time: FloatArray, place: FloatArray, columns: Columns
) -> Columns:
    """The same with the column along which steps are shortest as the agent, where there are
    several; FileError where no column divides them. time (R,), place (R, 2)."""
    good = np.flatnonzero(np.isfinite(time) & np.isfinite(place).all(axis=1))
    # A row that only repeats another one, as beside each of several people, is of the same agent.
    _, first = np.unique(np.column_stack([time, place])[good], axis=0, return_index=True)
    good = good[np.sort(first)]
    rows = good[np.argsort(time[good], kind="stable")][:_MOST_ROWS]
    if columns.agent >= 0 or not len(rows):
        return columns
    time, place = time[rows], place[rows]
    share_different = len(np.unique(time)) / len(time)
    jumps = _jumps(place, share_different)
    if share_different > _MOSTLY_DIFFERENT and jumps <= _MANY_JUMPS:
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
