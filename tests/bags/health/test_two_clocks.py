"""Clocks that jump or drift against each other are distinguished from late messages."""

import numpy as np
import pytest

from serd_bag.health.check import check_bag
from serd_bag.messages.clocks import ClockDifference, clock_difference
from serd_bag.messages.times import agrees, placed_s
from support.bag_messages import POSE, write_bag

STAMP_S = np.arange(600) * 0.1
AFTER_30_S = np.where(STAMP_S > 30.0, 1.0, 0.0)


def late_s(seed):
    """Time on the way, mostly short."""
    return np.random.default_rng(seed).exponential(0.01, size=len(STAMP_S))


def compared(stamp_s, late_s):
    """Stamps of a clock that goes wrong, against log times of one that is right."""
    log_s = STAMP_S + late_s
    return clock_difference(log_s, log_s - stamp_s)


@pytest.mark.parametrize("seed", range(2))
def test_a_receiver_that_stalls_is_not_a_clock_that_jumps_or_drifts(seed):
    found = compared(STAMP_S - 1e9, late_s(seed))
    assert (found.jumps, found.drift) == ((), 0.0)
    assert found.offset_s == pytest.approx(-1e9, abs=0.1)
    stalled_s = late_s(seed)
    held = (STAMP_S > 20.0) & (STAMP_S < 22.5)
    stalled_s[held] = 22.5 - STAMP_S[held]
    stalled_s[400] += 30.0
    assert compared(STAMP_S, stalled_s).jumps == ()


@pytest.mark.parametrize(
    ("pace", "jump_s"), [(1.0, 0.8), (1.0, -3600.0), (2.0, 0), (1.01, 0), (0.5, 0), (1.05, 5.0)]
)
def test_jumps_and_drifts_are_found_with_their_size_and_way(pace, jump_s):
    found = compared(STAMP_S * pace + jump_s * AFTER_30_S, late_s(4))
    sizes_s = [size_s for _, size_s in found.jumps]
    assert sizes_s == ([pytest.approx(jump_s, abs=0.2)] if jump_s else [])
    assert found.drift_s == pytest.approx((pace - 1.0) * found.span_s, rel=0.1)
    assert found.span_s == pytest.approx(57.0, abs=1.1)
    ahead_s = STAMP_S * (pace - 1.0) + jump_s * AFTER_30_S
    wrong = np.abs(found.ahead_s(STAMP_S + late_s(4)) - ahead_s) > 0.15
    assert np.count_nonzero(wrong) <= 2  # those on the way while the clock jumps


@pytest.mark.parametrize("number", [0, 1, 2, 30])
def test_a_few_seconds_give_an_offset_alone(number):
    log_s = STAMP_S[:number]
    found = clock_difference(log_s, np.full(number, -3600.0))
    assert (found.jumps, found.drift, found.span_s) == ((), 0.0, 0.0)
    assert found.offset_s == (3600.0 if number else ClockDifference().offset_s)


def through_a_link(busy_s, blocked=()):
    """Log times of a link that takes busy_s(time) for each message, one after the other."""
    log_s, free_s = [], 0.0
    for sent_s in STAMP_S:
        start_s = max(sent_s, free_s)
        start_s = next((end_s for first_s, end_s in blocked if first_s <= start_s < end_s), start_s)
        free_s = start_s + busy_s(start_s)
        log_s.append(free_s)
    return np.array(log_s)


@pytest.mark.parametrize(
    ("log_s", "n_held"),
    [
        (through_a_link(lambda s: 0.2 if 10.0 < s < 30.0 else 0.02), 1),
        (through_a_link(lambda s: 0.2 if s % 20.0 > 8.0 else 0.01), 3),
        (through_a_link(lambda s: 0.2 if s < 20.0 else 0.01), 1),
        (through_a_link(lambda s: 0.2 if s > 50.0 else 0.01), 1),
        (through_a_link(lambda _: 0.002, [(5.0, 12.0), (20.0, 33.0), (40.0, 41.0)]), 0),
        (np.ceil(STAMP_S / 3.0) * 3.0 + 0.01, 0),
    ],
)
@pytest.mark.parametrize("offset_s", [0.0, 3600.0, -7200.0])
def test_messages_that_a_link_holds_back_are_not_of_another_clock(log_s, n_held, offset_s):
    found = clock_difference(log_s, log_s - STAMP_S - offset_s)
    assert (found.jumps, found.drift, found.n_held) == ((), 0.0, n_held)
    assert found.offset_s == pytest.approx(offset_s, abs=0.15)
    clock_s = log_s + 1e9
    stamp_s = STAMP_S + 1e9 + offset_s
    assert agrees(clock_s, stamp_s) == (offset_s == 0.0)
    assert np.array_equal(placed_s(clock_s, stamp_s), clock_s if offset_s else stamp_s)


def ahead(offset_s):
    return lambda since_s: since_s + offset_s


@pytest.mark.parametrize(
    ("clocks", "remarks"),
    [
        (
            (lambda s: s + 3600.0 * (s >= 20.0), lambda s: 2.0 * s),
            (
                "/0: stamps jump against log times forward by 3600.00 s",
                "/1: stamps run ahead of log times by 37.00 s in 37 s",
            ),
        ),
        (
            (ahead(0.0), ahead(-2.0)),
            ("/1: stamps are 2.00 s behind log times: the clock of its sender is wrong",),
        ),
        (
            (ahead(-900.0), ahead(-900.0)),
            ("all stamps are 900.00 s behind log times: those of another or simulated time",),
        ),
        ((ahead(0.0), ahead(0.9)), ()),
    ],
)
def test_check_reports_clocks_that_differ(tmp_path, messages, clocks, remarks):
    rows = [
        (f"/{name}", 1000.0 + 0.1 * n, messages.pose(1000.0 + stamp_of(0.1 * n), 0.0, 0.0))
        for n in range(400)
        for name, stamp_of in enumerate(clocks)
    ]
    topics = {f"/{name}": POSE for name in range(len(clocks))}
    assert check_bag(write_bag(tmp_path / "bag", topics, rows)).remarks == remarks
