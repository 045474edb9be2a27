"""Faults of inputs, message by message, and what a guarded robot does then."""

import math
from dataclasses import replace

import numpy as np
import pytest

from lab.faults.campaign import COLUMNS, run_fault, tasks_of
from lab.faults.faults import FAULTS
from serd_files.yaml_config import model_yaml
from serd_sim.episodes.batch import EpisodeTask
from serd_sim.safety.reasons import Source
from serd_sim.safety.scan import Scan, ScanGeometry
from serd_sim.safety.world_guard import Message
from serd_sim.scenario.scenario import load_scenario

CONDITION = EpisodeTask("hallway", 0, n_people=2)


def _row(fault, guarded, condition=CONDITION):
    return run_fault(tasks_of([fault], condition, [1])[guarded])


@pytest.mark.parametrize(("drive", "rocking_m"), [("kinematic", 1e-9), ("physical", 1e-3)])
def test_with_the_guard_the_robot_stands_after_the_scan_stops_and_without_it_drives_on(
    drive, rocking_m, tmp_path
):
    path = tmp_path / "hallway.yaml"
    path.write_text(model_yaml(load_scenario("hallway").with_values("robot", drive=drive)))
    condition = replace(CONDITION, scenario=str(path))
    guarded, unguarded = (_row("scan_stops", each, condition) for each in (1, 0))
    assert guarded["began"] == unguarded["began"] == 1
    assert guarded["zero_s"] <= 0.25
    assert guarded["stood_m"] < 0.6
    assert guarded["later_m"] == pytest.approx(0.0, abs=rocking_m)
    assert unguarded["way_m"] > 5.0
    assert [column.name for column in COLUMNS] == list(guarded)


def test_without_a_fault_the_guard_changes_nothing():
    guarded, unguarded = _row("none", 1), _row("none", 0)
    assert math.isfinite(guarded["time_of_arrival_s"])
    for name in ("time_of_arrival_s", "way_m", "person_on_robot"):
        assert guarded[name] == unguarded[name]


PERIOD_S = 0.05
GEOMETRY = ScanGeometry(-3.1, 0.02, 0.1, 10.0)


def _arriving(fault, n_periods):
    """(published, arrived) messages of each control period."""
    channel = FAULTS[fault].make(np.random.default_rng(1), PERIOD_S)
    published = []
    for period in range(n_periods):
        stamp_s = period * PERIOD_S
        scan = Scan(stamp_s, np.full(300, 2.0 + period, dtype=np.float32), GEOMETRY)
        pose = Message(Source.POSE, stamp_s, (float(period), 0.0, 0.0))
        published.append([pose, Message(Source.SCAN, stamp_s, scan)])
    return published, [channel(messages) for messages in published]


@pytest.mark.parametrize(
    ("fault", "poses_m", "ranges_m"),
    [
        ("pose_stops", [], [2.0, 3.0, 4.0]),
        ("pose_frozen", [0.0, 0.0, 0.0], [2.0, 3.0, 4.0]),
        ("scan_frozen", [0.0, 1.0, 2.0], [2.0, 2.0, 2.0]),
        ("pose_jumps", [2.0, 3.0, 4.0], [2.0, 3.0, 4.0]),
    ],
)
def test_a_fault_changes_values_of_its_topic_alone_under_fresh_stamps(fault, poses_m, ranges_m):
    _, arrived = _arriving(fault, 3)
    of_pose, of_scan = (
        [each for messages in arrived for each in messages if each.source is source]
        for source in (Source.POSE, Source.SCAN)
    )
    assert [each.value[0] for each in of_pose] == poses_m
    assert [float(each.value.ranges_m.mean()) for each in of_scan] == ranges_m
    for messages in (of_pose, of_scan):
        stamps_s = [each.stamp_s for each in messages]
        assert stamps_s == [0.0, PERIOD_S, 2 * PERIOD_S][: len(messages)]
    assert [each.value.stamp_s for each in of_scan] == [each.stamp_s for each in of_scan]


@pytest.mark.parametrize("yaw_rad", [0.0, math.pi, 2.0])
def test_a_sector_ahead_is_ahead_of_the_robot_wherever_its_lidar_looks(yaw_rad):
    channel = FAULTS["scan_near"].make(np.random.default_rng(1), PERIOD_S)
    geometry = ScanGeometry(0.0, math.radians(1.0), 0.1, 10.0)
    scan = Scan(0.0, np.full(360, 2.0, dtype=np.float32), geometry, (0.1, 0.0, yaw_rad))
    ((message,),) = [channel([Message(Source.SCAN, 0.0, scan)])]
    hidden = message.value.angles_rad[np.isneginf(message.value.ranges_m)] + yaw_rad
    assert len(hidden) == pytest.approx(90, abs=1)
    assert np.cos(hidden).min() > math.cos(math.radians(45.1))


def test_late_messages_keep_their_stamps():
    published, arrived = _arriving("delay_1s", 22)
    assert arrived[:20] == [[]] * 20
    assert arrived[20:] == published[:2]


def test_a_noisy_scan_loses_its_share_of_rays_and_deviates_by_five_centimetres():
    _, arrived = _arriving("scan_noise", 40)
    away_m = [messages[1].value.ranges_m - 2.0 - n for n, messages in enumerate(arrived)]
    ranges_m = np.stack(away_m)
    lost = ~np.isfinite(ranges_m)
    assert lost.mean() == pytest.approx(0.1, abs=0.01)
    assert ranges_m[~lost].std() == pytest.approx(0.05, rel=0.03)
