"""When demonstrations entered the goal area, from the spans of their episodes."""

import numpy as np

from serd_app.demonstrations.goal_entry import goal_entries_s
from serd_app.drives.episode_spans import EpisodeSpan
from serd_core.demonstrations.decisions import Decisions

#: Episodes that arrive 1.1 s and 2 s after a decision, time out, and arrive unobserved.
SPANS = (
    EpisodeSpan(0, 10.0, 15.1, "arrived"),
    EpisodeSpan(1, 20.0, 26.0, "arrived"),
    EpisodeSpan(2, 30.0, 35.0, "timeout"),
    EpisodeSpan(3, 40.0, 50.0, "arrived"),
)


def decisions_at(times_s):
    rows = np.zeros(len(times_s), dtype=np.int64)
    return Decisions(rows, np.array(times_s), rows, rows, rows)


def test_it_is_the_time_from_the_last_decision_to_the_arrival():
    decisions = decisions_at([10, 12, 14, 20, 22, 24, 30, 32, 34, 40])
    assert goal_entries_s(SPANS, decisions, 2.0).tolist() == [1.1, 2.0]


def test_without_decisions_there_is_none():
    assert len(goal_entries_s(SPANS, decisions_at([]), 2.0)) == 0
