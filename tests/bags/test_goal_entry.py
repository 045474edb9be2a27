"""When demonstrations entered the goal area, from the marks of a bag."""

import numpy as np
import pytest

from bags.goal_entry import goal_entry_times_s
from bags.writer import BagWriter
from serd_core.demonstrations import Decisions

DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"


def decisions_at(times_s):
    rows = np.zeros(len(times_s), dtype=np.int64)
    return Decisions(rows, np.array(times_s), rows, rows, rows)


@pytest.fixture
def marked_bag(tmp_path, messages):
    """Episodes that arrive 1.1 s and 2 s after a decision, time out, and arrive unobserved."""
    with BagWriter(tmp_path / "marked") as writer:
        writer.add_topic("/episode", DIAGNOSTICS)
        spans = (
            (10, 15.1, "arrived"),
            (20, 26, "arrived"),
            (30, 35, "timeout"),
            (40, 50, "arrived"),
        )
        for number, (start_s, end_s, outcome) in enumerate(spans):
            start = messages.mark(float(start_s), "start", number)
            writer.write("/episode", start, round(start_s * 1e9))
            end = messages.mark(float(end_s), "end", number, outcome)
            writer.write("/episode", end, round(end_s * 1e9))
    return tmp_path / "marked"


def test_it_is_the_time_from_the_last_decision_to_the_arrival(marked_bag):
    decisions = decisions_at([10, 12, 14, 20, 22, 24, 30, 32, 34, 40])
    found = goal_entry_times_s(marked_bag, decisions, 2.0)
    assert found.tolist() == [1.1, 2.0]


def test_without_decisions_there_is_none(marked_bag):
    assert len(goal_entry_times_s(marked_bag, decisions_at([]), 2.0)) == 0
