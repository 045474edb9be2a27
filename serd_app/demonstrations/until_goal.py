"""Episodes end where they first enter the goal: there the robot has nothing left to decide."""

import numpy as np

from serd_core.arrays import IntArray
from serd_core.demonstrations.decisions import Decisions


def last_states(decisions: Decisions) -> IntArray:
    """The states in which the episodes end, each once."""
    last = [np.flatnonzero(decisions.episode == each)[-1] for each in decisions.episodes]
    return np.unique(decisions.next_state[last])


def until_goal(decisions: Decisions, goal_states: IntArray) -> Decisions:
    """The decisions of every episode up to the first that leads into the goal."""
    kept = np.ones(len(decisions), dtype=bool)
    for episode in decisions.episodes:
        rows = np.flatnonzero(decisions.episode == episode)
        over = np.isin(decisions.state[rows], goal_states)
        over[1:] |= np.isin(decisions.next_state[rows[:-1]], goal_states)
        kept[rows] = ~np.maximum.accumulate(over)
    return decisions.select(kept)


def n_reaching(decisions: Decisions, goal_states: IntArray) -> int:
    """Episodes that begin elsewhere and come to the goal.

    One that decides in it has come to it, also where its move there counts as one to a neighbour.
    """
    there = np.isin(decisions.state, goal_states) | np.isin(decisions.next_state, goal_states)
    began_elsewhere = until_goal(decisions, goal_states).episodes
    return int(np.isin(began_elsewhere, decisions.episode[there]).sum())
