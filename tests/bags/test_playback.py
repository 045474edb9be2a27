"""Replay gives every message once, in order, at its time."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bags.errors import BagError
from bags.playback import Playback
from bags.topic import RawMessage


def recorded(*times_s):
    """Messages at those log times."""
    times_ns = [round(time_s * 1e9) for time_s in times_s]
    return [RawMessage("/x", "std_msgs/msg/String", b"", time_ns, 0) for time_ns in times_ns]


def test_messages_come_at_their_time_at_any_rate():
    playback = Playback(recorded(100.0, 101.0, 102.0), rate=2.0)
    assert len(playback.due(7.0)) == 1
    assert playback.wait_s(7.0) == pytest.approx(0.5)
    assert len(playback.due(7.4)) == 0
    assert len(playback.due(7.5)) == 1
    assert playback.bag_time_ns(7.75) == 101_500_000_000
    playback.set_rate(7.75, 0.5)
    assert playback.wait_s(7.75) == pytest.approx(1.0)
    assert len(playback.due(9.0)) == 1
    assert playback.finished
    assert playback.wait_s(9.0) == math.inf


def test_a_pause_stops_bag_time_and_a_step_goes_one_message_on():
    playback = Playback(recorded(0.0, 1.0, 2.0))
    playback.due(0.0)
    playback.pause(0.5)
    assert playback.due(50.0) == []
    assert playback.bag_time_ns(60.0) == 500_000_000
    assert playback.step() is not None
    assert playback.bag_time_ns(60.0) == 1_000_000_000
    playback.resume(60.0)
    assert playback.wait_s(60.0) == pytest.approx(1.0)
    assert len(playback.due(61.0)) == 1
    assert playback.step() is None


def test_a_log_time_that_steps_back_is_due_at_once():
    playback = Playback(recorded(10.0, 5.0, 11.0))
    assert len(playback.due(0.0)) == 2
    assert playback.bag_time_ns(0.5) == 10_500_000_000


@pytest.mark.parametrize("rate", [0.0, -1.0, math.nan, math.inf])
def test_a_wrong_rate_gets_a_sentence(rate):
    with pytest.raises(BagError, match="rate must be finite and above 0"):
        Playback(recorded(1.0), rate=rate)


@given(
    times_s=st.lists(st.floats(0, 5), max_size=20),
    walls_s=st.lists(st.floats(0, 1), max_size=20),
    rate=st.floats(0.1, 10),
)
def test_every_message_comes_once_and_in_order(times_s, walls_s, rate):
    messages = recorded(*times_s)
    playback, wall_s, found, clock_ns = Playback(messages, rate=rate), 0.0, [], -1
    for step_s in [0.0, *walls_s, 1e3]:
        wall_s += step_s
        found += playback.due(wall_s)
        assert playback.bag_time_ns(wall_s) >= clock_ns
        clock_ns = playback.bag_time_ns(wall_s)
    assert found == messages
    assert playback.finished
