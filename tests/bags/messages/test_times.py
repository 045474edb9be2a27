"""Times of messages when they are recorded and when they are read, with faulty stamps."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from serd_bag.messages.times import RecordingClock, agrees, placed_s

NOW_NS = 1_700_000_000 * 10**9
times_ns = st.integers(-(2**62), 2**62)


@given(times_ns, times_ns)
def test_log_time_is_that_of_receipt_and_publish_time_is_the_publishers(stamp_ns, sent_ns):
    log_ns, published_ns = RecordingClock(simulated=False).times_ns(stamp_ns, NOW_NS, sent_ns)
    assert log_ns == NOW_NS
    assert published_ns == (sent_ns if sent_ns > 0 else stamp_ns if stamp_ns > 0 else NOW_NS)


@given(st.lists(st.tuples(times_ns, times_ns, st.booleans()), max_size=20), st.booleans())
def test_every_message_gets_times_that_a_bag_can_hold(rows, simulated):
    clock = RecordingClock(simulated=simulated)
    for stamp_ns, sent_ns, is_clock in rows:
        for time_ns in clock.times_ns(stamp_ns, NOW_NS, sent_ns, is_clock=is_clock):
            assert 0 <= time_ns < 2**63


def test_in_simulated_time_both_are_the_stamp_or_the_newest_one():
    clock = RecordingClock(simulated=True)
    assert clock.times_ns(0, NOW_NS, NOW_NS) == (0, 0)
    assert clock.times_ns(5 * 10**9, NOW_NS, NOW_NS) == (5 * 10**9, 5 * 10**9)
    assert clock.times_ns(0, NOW_NS, NOW_NS) == (5 * 10**9, 5 * 10**9)
    assert clock.times_ns(4 * 10**9, NOW_NS, NOW_NS) == (4 * 10**9, 4 * 10**9)
    assert clock.now_ns == 5 * 10**9
    assert clock.times_ns(10**9, NOW_NS, NOW_NS, is_clock=True) == (10**9, 10**9)
    assert clock.times_ns(0, NOW_NS, NOW_NS) == (10**9, 10**9)


def test_a_stamp_of_the_machines_clock_does_not_move_simulated_time():
    clock = RecordingClock(simulated=True)
    clock.times_ns(7 * 10**9, NOW_NS, NOW_NS, is_clock=True)
    assert clock.times_ns(NOW_NS, NOW_NS, NOW_NS) == (7 * 10**9, 7 * 10**9)
    assert clock.times_ns(0, NOW_NS, NOW_NS) == (7 * 10**9, 7 * 10**9)


LOG_S = 1e9 + 0.1 * np.arange(100)
LATE_S = np.random.default_rng(1).exponential(0.02, size=100)
STAMP_S = LOG_S - LATE_S


def test_messages_are_placed_by_stamps_that_agree_also_when_single_ones_are_late():
    stamp_s = STAMP_S.copy()
    stamp_s[50] -= 5.0
    assert np.array_equal(placed_s(LOG_S, stamp_s), stamp_s)


@pytest.mark.parametrize("offset_s", [3600.0, -3600.0, 1.5, -1.5])
def test_messages_of_a_clock_that_is_wrong_are_placed_by_log_time(offset_s):
    assert not agrees(LOG_S, STAMP_S + offset_s)
    for stamp_s in (STAMP_S + offset_s, np.zeros(100), LOG_S[0] - 100.0 * np.arange(100)):
        assert np.array_equal(placed_s(LOG_S, stamp_s), LOG_S)


def test_single_stamps_that_are_wrong_are_replaced_by_log_time():
    stamp_s = STAMP_S.copy()
    stamp_s[[10, 20, 30, 40]] = 0.0, np.nan, STAMP_S[30] + 3600.0, STAMP_S[40] - 3600.0
    expected_s = STAMP_S.copy()
    expected_s[[10, 20, 30, 40]] = LOG_S[[10, 20, 30, 40]]
    assert np.array_equal(placed_s(LOG_S, stamp_s), expected_s)
