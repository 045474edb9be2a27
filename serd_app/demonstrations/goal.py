"""Where demonstrations reach the goal: decisions up to it, and the time of entry."""

from collections.abc import Sequence

import numpy as np

from serd_app.drives.episode_spans import EpisodeSpan
from serd_core.arrays import FloatArray, IntArray
from serd_core.demonstrations.decisions import Decisions

_ROUNDING_S = 1e-6


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


def goal_entries_s(
    episodes: Sequence[EpisodeSpan], decisions: Decisions, decision_period_s: float
) -> FloatArray:
    """(E,) seconds from the last decision to the end of every episode that arrived.

    decisions: those of the same drive. Episodes whose last decision is missing are left out.
    """
    arrived = [span for span in episodes if span.outcome == "arrived"]
    entry_s = np.array([span.end_s - _last_decision_s(decisions, span) for span in arrived])
    known = (entry_s > _ROUNDING_S) & (entry_s <= decision_period_s + _ROUNDING_S)
    # Stamps are whole nanoseconds; differences of seconds as doubles are not.
    return np.asarray(np.minimum(entry_s[known], decision_period_s).round(9))


def _last_decision_s(decisions: Decisions, span: EpisodeSpan) -> float:
    """Time of the last decision within an episode, minus infinity where there is none."""
    time_s = decisions.time_s
    inside = (time_s >= span.start_s - _ROUNDING_S) & (time_s < span.end_s)
    return float(time_s[inside].max(initial=-np.inf))
