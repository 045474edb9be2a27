"""Episodes of a table in which ids and times restart: by a column, or where times go back."""

from dataclasses import replace

import numpy as np

from serd_core.arrays import FloatArray, IntArray
from storage.trajectories.cells import Cells
from storage.trajectories.columns import Columns

#: Fewest rows per episode; a column with more values than that does not number episodes.
_FEWEST_ROWS = 5
#: Share of repeated times above which an episode has several agents.
_FEW_REPEATED = 0.01
#: Smallest share of an episode by which time goes back where the next one begins.
_BACK = 0.5
#: Pause put between episodes whose times overlap, so that agents of one are not seen in another.
_APART_S = 100.0


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
