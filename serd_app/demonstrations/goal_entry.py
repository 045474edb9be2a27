"""When, within its last decision period, each recorded demonstration entered the goal area."""

from collections.abc import Sequence

import numpy as np

from serd_app.drives.episode_spans import EpisodeSpan
from serd_core.arrays import FloatArray
from serd_core.demonstrations.decisions import Decisions

_ROUNDING_S = 1e-6


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
