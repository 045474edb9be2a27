"""Decisions (s, a, s', dwell time) as a CSV table, several as one, and those up to the goal."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np
from scipy.ndimage import binary_dilation, label

from serd_app.errors import AppError
from serd_bag.errors import FileError
from serd_core.arrays import IntArray
from serd_core.demonstrations.decisions import Decisions
from serd_core.errors import SerdError
from serd_core.grid.grid import Grid
from serd_core.semi_markov.timed_decisions import TIMED_COLUMNS, TimedDecisions
from serd_files.table import Column, read_table, write_table

COLUMNS = (
    Column("episode", int),
    Column("time_s", float),
    Column("state", int),
    Column("action", int),
    Column("next_state", int),
    Column("dwell_s", float),
    Column("censored", int),
    Column("source", str),
)
_LABEL = ", episodes"


def save_decisions(path: str | Path, decisions: TimedDecisions) -> None:
    """Write one line per decision below a line of column names; censored: 0 or 1."""
    numbers = [getattr(decisions, each.name).astype(each.kind).tolist() for each in COLUMNS[:-1]]
    rows = ((*row, decisions.source) for row in zip(*numbers, strict=True))
    write_table(path, COLUMNS, rows)


def load_decisions(path: str | Path) -> TimedDecisions:
    """Read what `save_decisions` wrote; FileError names the line and the column of a fault."""
    rows = read_table(path, COLUMNS)
    try:
        return TimedDecisions(
            **{
                each.name: np.array([row[each.name] for row in rows], dtype=each.kind)
                for each in COLUMNS[:-1]
            },
            source="; ".join(dict.fromkeys(row["source"] for row in rows)),
        )
    except SerdError as error:
        raise FileError(f"{path}: {error}") from None


def concatenate(tables: Sequence[TimedDecisions]) -> TimedDecisions:
    """All rows of several tables, one after the other; episodes keep their numbers."""
    columns = {
        name: np.concatenate([getattr(each, name) for each in tables]) for name in TIMED_COLUMNS
    }
    sources = dict.fromkeys(each.source for each in tables)
    return TimedDecisions(**columns, source="; ".join(sources))


def concatenate_renumbered(tables: Sequence[TimedDecisions]) -> TimedDecisions:
    """All rows in the order given; episodes of later tables are numbered on from the last.

    Episodes keep their numbers in the first table; within each table their order is kept. Where
    the sources differ, the source of the result names the episodes of each.
    """
    if not tables:
        raise AppError("tables must hold at least one table of decisions, got none")
    episodes, following = [], 0
    for table in tables:
        shift = max(0, following - int(table.episode.min(initial=following)))
        episodes.append(table.episode + shift)
        following = max(following, int(episodes[-1].max(initial=-1)) + 1)
    found = replace(concatenate(tables), episode=np.concatenate(episodes))
    sources = [table.source for table in tables]
    if len(set(sources)) == 1:
        return found
    for row, numbers in enumerate(episodes):
        if len(numbers) and _LABEL not in sources[row]:
            sources[row] += f"{_LABEL} {numbers.min()} to {numbers.max()}"
    return replace(found, source="; ".join(sources))


_Table = TypeVar("_Table", bound=Decisions)


def usual_goal_states(decisions: Decisions, grid: Grid) -> IntArray:
    """The states in which the episodes end, or of these the neighbouring ones that leave more
    decisions before the goal: on round trips and in crowds, some begin where others end."""
    best = np.unique(list(_ends(decisions).values()))
    most = len(until_goal(decisions, best))
    for group in _neighbouring(best, grid):
        n_left = len(until_goal(ending_in(decisions, group), group))
        if n_left > most:
            best, most = group, n_left
    return best


def ending_in(decisions: _Table, states: IntArray) -> _Table:
    """The decisions of the episodes that end in one of the states."""
    wanted = set(states.tolist())
    return decisions.select_episodes(
        episode for episode, end in _ends(decisions).items() if end in wanted
    )


def _ends(decisions: Decisions) -> dict[int, int]:
    """The last state of each episode."""
    return dict(zip(decisions.episode.tolist(), decisions.next_state.tolist(), strict=True))


def _neighbouring(states: IntArray, grid: Grid) -> list[IntArray]:
    """The states in groups, between which there are three cells or more."""
    picture = np.zeros(grid.walkable.shape, dtype=bool)
    rows, columns = grid.cells[states].T
    picture[rows, columns] = True
    around = np.ones((3, 3))
    labels, count = label(binary_dilation(picture, around), around)
    return [states[labels[rows, columns] == group + 1] for group in range(count)]


def until_goal(decisions: _Table, goal_states: IntArray) -> _Table:
    """The decisions of every episode up to the first that leads into the goal."""
    kept = np.ones(len(decisions), dtype=bool)
    for episode in decisions.episodes:
        rows = np.flatnonzero(decisions.episode == episode)
        over = np.isin(decisions.state[rows], goal_states)
        over[1:] |= np.isin(decisions.next_state[rows[:-1]], goal_states)
        kept[rows] = ~np.maximum.accumulate(over)
    return decisions.select(kept)


def episodes_reaching(decisions: Decisions, goal_states: IntArray) -> IntArray:
    """(E,) numbers of the episodes that begin elsewhere and come to the goal.

    One that decides in it has come to it, also where its move there is not recorded.
    """
    there = np.isin(decisions.state, goal_states) | np.isin(decisions.next_state, goal_states)
    began_elsewhere = until_goal(decisions, goal_states).episodes
    return np.asarray(began_elsewhere[np.isin(began_elsewhere, decisions.episode[there])])
