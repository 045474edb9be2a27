"""Faults of inputs: what arrives of the messages of each control period."""

import numpy as np
import pytest

from lab.faults.faults import FAULTS
from serd_sim.safety.reasons import Source
from serd_sim.safety.scan import Scan, ScanGeometry
from serd_sim.safety.world_guard import Message

PERIOD_S = 0.05
GEOMETRY = ScanGeometry(-3.1, 0.02, 0.1, 10.0)


def _arriving(fault, n_periods):
    """(published, arrived) messages of each control period."""
    channel = FAULTS[fault].make(np.random.default_rng(1), PERIOD_S)
    published = []
    for period in range(n_periods):
        stamp_s = period * PERIOD_S
        ranges_m = np.full(300, 2.0 + period, dtype=np.float32)
        published.append(
            [
                Message(Source.POSE, stamp_s, (float(period), 0.0, 0.0)),
                Message(Source.SCAN, stamp_s, Scan(stamp_s, ranges_m, GEOMETRY)),
            ]
        )
    return published, [channel(messages) for messages in published]


def test_a_topic_that_stops_leaves_the_others():
    _, arrived = _arriving("pose_stops", 2)
    assert [[each.source for each in messages] for messages in arrived] == [[Source.SCAN]] * 2


def test_a_frozen_pose_keeps_its_first_value_under_fresh_stamps():
    _, arrived = _arriving("pose_frozen", 3)
    assert [messages[0].value for messages in arrived] == [(0.0, 0.0, 0.0)] * 3
    assert [messages[0].stamp_s for messages in arrived] == [0.0, PERIOD_S, 2 * PERIOD_S]


def test_a_frozen_scan_keeps_its_ranges_under_fresh_stamps():
    _, arrived = _arriving("scan_frozen", 3)
    scans = [messages[1].value for messages in arrived]
    assert all((scan.ranges_m == 2.0).all() for scan in scans)
    assert [scan.stamp_s for scan in scans] == [0.0, PERIOD_S, 2 * PERIOD_S]


def test_late_messages_keep_their_stamps():
    published, arrived = _arriving("delay_1s", 22)
    assert arrived[:20] == [[]] * 20
    assert arrived[20:] == published[:2]


def test_a_jump_moves_every_pose_by_two_metres():
    _, arrived = _arriving("pose_jumps", 2)
    assert [messages[0].value[0] for messages in arrived] == [2.0, 3.0]


def test_a_noisy_scan_loses_its_share_of_rays_and_deviates_by_five_centimetres():
    _, arrived = _arriving("scan_noise", 40)
    ranges_m = np.stack(
        [messages[1].value.ranges_m - 2.0 - n for n, messages in enumerate(arrived)]
    )
    lost = ~np.isfinite(ranges_m)
    assert lost.mean() == pytest.approx(0.1, abs=0.01)
    assert ranges_m[~lost].std() == pytest.approx(0.05, rel=0.03)
