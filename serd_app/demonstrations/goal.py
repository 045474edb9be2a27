"""Where demonstrations reach the goal, and their decisions up to it."""

from typing import TypeVar

import numpy as np
from scipy.ndimage import binary_dilation, label

from serd_core.arrays import IntArray
from serd_core.demonstrations.decisions import Decisions
from serd_core.grid.grid import Grid

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
