"""Metrics of episodes, on cases that are computed by hand."""

import math

import numpy as np
import pytest

from serd_core.grid.grid import Action
from serd_sim.episodes.metrics import MetricsObserver, time_to_collision_s
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.command import STOP, Command
from support.observations import observation_at

CORRIDOR = load_scenario("corridor")  # periods of 0.05 s; bodies touch at 0.5 m


def metrics_of(*ticks, commands=None):
    """Of (pose, speed, people, their velocities) at each tick."""
    observer = MetricsObserver(CORRIDOR)
    for number, (pose, speed_mps, *people) in enumerate(ticks):
        seen = observation_at(
            *pose,
            tick=number,
            speed_mps=speed_mps,
            **dict(zip(("people", "velocity"), people, strict=False)),
        )
        observer.see(seen, commands[number] if commands else STOP, Action.NORTH)
    return observer.metrics


def test_discs_that_drive_at_each_other_touch_after_the_gap_over_the_closing_speed():
    away = np.array([[3.0, 0.0], [3.0, 0.6], [3.0, 0.0], [0.4, 0.0], [0.0, 2.0]])
    velocity = np.array([[-1.0, 0.0], [-1.0, 0.0], [1.0, 0.0], [1.0, 0.0], [0.0, 0.0]])
    times = time_to_collision_s(away, velocity, reach_m=0.5)
    assert times.tolist() == [pytest.approx(2.5), math.inf, math.inf, 0.0, math.inf]
    grazing = time_to_collision_s(np.array([[3.0, 0.3]]), np.array([[-1.0, 0.0]]), 0.5)
    assert grazing[0] == pytest.approx(3.0 - 0.4)


def test_a_person_ahead_counts_once_the_bodies_would_touch_within_a_second():
    far = ((2.0, 5.0, math.pi / 2), 1.0, [(2.0, 8.0)], [(0.0, -1.0)])  # 2.5 m / 2 m/s
    near = ((2.0, 5.5, math.pi / 2), 1.0, [(2.0, 7.5)], [(0.0, -1.0)])  # 1.5 m / 2 m/s
    turned = ((2.0, 5.5, -math.pi / 2), 1.0, [(2.0, 7.5)], [(0.0, -1.0)])  # same velocity
    assert metrics_of(far, near, turned, far).collision_ahead_share == 0.25


def test_zones_of_a_person_are_gaps_between_the_bodies():
    gaps = [((2.0, 5.0, 0.0), 0.0, [(2.0 + 0.5 + gap, 5.0)], [(0.0, 0.0)]) for gap in (0.1, 0.9, 1)]
    metrics = metrics_of(*gaps, ((2.0, 5.0, 0.0), 0.0))
    assert metrics.intimate_share == 0.25
    assert metrics.personal_share == 0.5


def test_speeds_give_standing_share_and_jerk():
    speeds = (0.0, 0.04, 0.1, 0.1)
    metrics = metrics_of(*(((2.0, 5.0, 0.0), speed) for speed in speeds))
    assert metrics.standing_share == 0.5
    assert metrics.mean_speed_mps == pytest.approx(0.06)
    second_differences = (0.02, -0.06)
    assert metrics.mean_abs_jerk_mps3 == pytest.approx(np.abs(second_differences).mean() / 0.05**2)


def test_turning_is_per_metre_of_way_and_over_the_border_of_angles():
    poses = [(2.0, 5.0, math.pi - 0.1), (2.0, 6.0, -math.pi + 0.1), (2.0, 7.0, math.pi - 0.1)]
    metrics = metrics_of(*((pose, 1.0) for pose in poses))
    assert metrics.path_irregularity_radpm == pytest.approx(0.4 / 2.0)


def test_commands_give_the_mean_change_per_second():
    commands = [Command(0.0, 0.0), Command(0.1, 1.0), Command(0.1, 0.5)]
    metrics = metrics_of(*[((2.0, 5.0, 0.0), 0.0)] * 3, commands=commands)
    assert metrics.mean_abs_acceleration_mps2 == pytest.approx(0.1 / 0.05 / 2)
    assert metrics.mean_abs_turn_acceleration_radps2 == pytest.approx(1.5 / 0.05 / 2)
