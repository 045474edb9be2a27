"""Clocks that jump or drift against each other are distinguished from late messages."""

import numpy as np
import pytest

from serd_bag.health.check import TwoClocks, check_bag, two_clocks
from serd_bag.writer import BagWriter

POSE = "geometry_msgs/msg/PoseStamped"
STAMP_S = np.arange(600) * 0.1


def lateness_s(rng):
    """Time on the way, mostly short."""
    return rng.exponential(0.01, size=len(STAMP_S))


def compared(stamp_s, late_s):
    """Stamps of a clock that goes wrong, against log times of one that is right."""
    log_s = STAMP_S + late_s
    return two_clocks(log_s, log_s - stamp_s)


@pytest.mark.parametrize("seed", range(2))
def test_two_clocks_of_the_same_rate_have_no_jump_and_no_drift(seed):
    rng = np.random.default_rng(seed)
    found = compared(STAMP_S - 1e9, lateness_s(rng))
    assert (found.jumps_s, found.drift_s) == ((), 0.0)
    assert found.offset_s == pytest.approx(-1e9, abs=0.1)


@pytest.mark.parametrize("seed", range(2))
def test_a_receiver_that_stalls_is_not_a_clock_that_jumps(seed):
    rng = np.random.default_rng(seed)
    late_s = lateness_s(rng)
    held = (STAMP_S > 20.0) & (STAMP_S < 22.5)
    late_s[held] = 22.5 - STAMP_S[held]
    late_s[400] += 30.0
    assert compared(STAMP_S, late_s).jumps_s == ()


@pytest.mark.parametrize("jump_s", [0.8, -3600.0])
def test_a_jump_is_found_with_its_size_and_way(jump_s):
    rng = np.random.default_rng(3)
    found = compared(STAMP_S + np.where(STAMP_S > 30.0, jump_s, 0.0), lateness_s(rng))
    assert found.offset_s == 0.0
    assert found.jumps_s == (pytest.approx(jump_s, abs=0.05),)
    assert found.drift_s == 0.0


@pytest.mark.parametrize("pace", [2.0, 1.01, 0.99, 0.5])
def test_a_clock_of_another_rate_is_found_by_its_drift(pace):
    found = compared(STAMP_S * pace, lateness_s(np.random.default_rng(4)))
    assert found.jumps_s == ()
    assert found.drift_s == pytest.approx((pace - 1.0) * found.span_s, rel=0.05)
    assert found.span_s == pytest.approx(57.0, abs=1.1)


def test_a_jump_is_separated_from_a_drift():
    stamp_s = STAMP_S * 1.05 + np.where(STAMP_S > 30.0, 5.0, 0.0)
    found = compared(stamp_s, lateness_s(np.random.default_rng(5)))
    assert found.jumps_s == (pytest.approx(5.0, abs=0.2),)
    assert found.drift_s == pytest.approx(0.05 * found.span_s, rel=0.1)


@pytest.mark.parametrize("number", [0, 1, 2, 30])
def test_a_few_seconds_give_no_result(number):
    assert two_clocks(STAMP_S[:number], STAMP_S[:number]) == TwoClocks()


def test_check_reports_jump_and_drift(tmp_path, messages):
    with BagWriter(tmp_path / "bag") as writer:
        for name in ("/jumping", "/running"):
            writer.add_topic(name, POSE)
        for number in range(400):
            log_s = 1000.0 + 0.1 * number
            jumping_s = log_s + (3600.0 if number >= 200 else 0.0)
            for name, stamp_s in (("/jumping", jumping_s), ("/running", 1000.0 + 0.2 * number)):
                writer.write(name, messages.pose(stamp_s, 0.0, 0.0), round(log_s * 1e9))
    assert check_bag(tmp_path / "bag").remarks == (
        "/jumping: stamps jump against log times forward by 3600.00 s",
        "/running: stamps run ahead of log times by 37.00 s in 37 s",
    )


@pytest.mark.parametrize(
    ("offsets_s", "remarks"),
    [
        ((0.0, 3600.0), ("/1: stamps are 3600.00 s ahead of log times: the clock of its sender",)),
        ((0.0, -2.0), ("/1: stamps are 2.00 s behind log times: the clock of its sender is",)),
        ((-900.0, -900.0), ("all stamps are 900.00 s behind log times: those of another",)),
        ((0.0, 0.9), ()),
    ],
)
def test_check_reports_clocks_that_differ_by_a_constant(tmp_path, messages, offsets_s, remarks):
    with BagWriter(tmp_path / "bag") as writer:
        for name in range(len(offsets_s)):
            writer.add_topic(f"/{name}", POSE)
        for number in range(100):
            log_s = 1000.0 + 0.1 * number
            for name, offset_s in enumerate(offsets_s):
                pose = messages.pose(log_s + offset_s, 0.0, 0.0)
                writer.write(f"/{name}", pose, round(log_s * 1e9))
    found = check_bag(tmp_path / "bag").remarks
    assert len(found) == len(remarks)
    assert all(line.startswith(start) for line, start in zip(found, remarks, strict=True))
