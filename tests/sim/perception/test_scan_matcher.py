"""Scans and observations are brought together by their stamps, in whatever order they come."""

import numpy as np
import pytest

from serd_sim.perception.scanning_planner import ScanMatcher
from serd_sim.planning.local_planner import make_planner
from serd_sim.robot.sensors import Lidar
from serd_sim.scenario.scenario import load_scenario
from support.observations import observation_at

HALLWAY = load_scenario("hallway")
LIDAR = Lidar(HALLWAY.lidar, HALLWAY.wall_segments_m, 0.25)


def standing(tick):
    return observation_at(3.0, 8.0, tick=tick)


def scan_at(tick, x_m):
    return 50_000_000 * tick, LIDAR.scan((3.0, 8.0, 0.0), np.array([x_m]), np.array([8.0]))


@pytest.fixture
def matcher():
    return ScanMatcher(HALLWAY)


@pytest.mark.parametrize("scan_first", [True, False])
def test_a_scan_counts_once_the_observation_of_its_stamp_is_there(matcher, scan_first):
    steps = [
        lambda: matcher.take_scan(*scan_at(4, 4.5)),
        lambda: matcher.take_observation(standing(4)),
    ]
    for step in steps if scan_first else reversed(steps):
        assert not matcher.is_complete(standing(4))
        step()
    assert matcher.is_complete(standing(4))


def test_a_scan_sent_twice_is_taken_once(matcher):
    """Of two scans of a walker 0.1 s apart, the second one again would make him stand."""
    planner = matcher.planner_on(make_planner(HALLWAY))
    for tick, x_m in ((2, 4.5), (4, 4.6), (4, 4.6), (4, 4.6)):
        matcher.take_observation(standing(tick))
        matcher.take_scan(*scan_at(tick, x_m))
    again = planner.perception.tracker.velocity_mps[0, 0]
    assert again == pytest.approx(0.25, abs=0.05)  # beta times 1 m/s
