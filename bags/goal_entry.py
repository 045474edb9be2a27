"""When, within its last decision period, each recorded demonstration entered the goal area."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bags.reader import BagReader, topic_named
from bags.recorded_drive import EPISODE, DriveBuilder, EpisodeSpan
from serd_core.arrays import FloatArray
from serd_core.demonstrations import Decisions

_ROUNDING_S = 1e-6


def goal_entry_times_s(
    directory: str | Path, decisions: Decisions, decision_period_s: float
) -> FloatArray:
    """(E,) seconds from the last decision to the end of every episode that arrived.

    decisions: those of the same bag. Episodes whose last decision is missing are left out.
    """
    reader = BagReader(directory)
    builder = DriveBuilder(str(directory))
    for message in reader.messages([topic_named(reader.topics, EPISODE)]):
        builder.add_mark(message.data, message.log_time_ns)
    return goal_entries_s(builder.drive().episodes, decisions, decision_period_s)


def goal_entries_s(
    episodes: Sequence[EpisodeSpan], decisions: Decisions, decision_period_s: float
) -> FloatArray:
    """The same of episodes that are known already."""
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
