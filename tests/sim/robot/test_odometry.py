"""Dead reckoning: the truth without drift, and drift as set."""

import math

import numpy as np
import pytest

from serd_sim.robot.sensors import Odometry
from serd_sim.scenario.scenario import load_scenario
from serd_sim.scenario.settings import OdometrySettings
from serd_sim.world.command import Command
from serd_sim.world.world import HallwayWorld

EMPTY = load_scenario("hallway").with_pedestrian_count(0)


def straight(odometry, n_steps):
    for step in range(1, n_steps + 1):
        odometry.follow((0.05 * step, 0.0, 0.0))
    return odometry.pose


def test_without_deviations_odometry_is_the_truth_bit_for_bit_and_with_them_it_drifts():
    """Wheels of a physical robot slip, so this one is kinematic."""
    exact = EMPTY.with_values("robot", drive="kinematic")
    drifting = exact.with_values("odometry", distance_scale_deviation=0.05, turn_noise_rad=0.05)
    poses = []
    for scenario in (exact, drifting):
        with HallwayWorld(scenario, seed=1) as world:
            world.reset(0)
            for _ in range(50):
                seen = world.step(Command(0.6, 0.5))
            poses += [seen.pose[:2], world.odometry_pose[:2]]
    assert poses[0] == poses[1] == poses[2]
    assert math.dist(*poses[2:]) > 0.01


def test_a_scale_error_stretches_the_way():
    settings = OdometrySettings(distance_scale_deviation=0.1)
    rng = np.random.default_rng(1)
    scale = 1.0 + 0.1 * np.random.default_rng(1).standard_normal(2)[0]
    x_m, y_m, yaw_rad = straight(Odometry(settings, (0.0, 0.0, 0.0), rng), 200)
    assert (x_m, y_m, yaw_rad) == pytest.approx((10.0 * scale, 0.0, 0.0))


def test_a_scale_error_of_turns_bends_a_circle_into_another_exact_one():
    """A way s that turns by a ends at s / a (sin a, 1 - cos a), with a stretched by the scale."""
    settings = OdometrySettings(turn_scale_deviation=0.1)
    odometry = Odometry(settings, (0.0, 0.0, 0.0), np.random.default_rng(1))
    radius_m, n_steps = 2.0, 20
    for angle in np.linspace(0.0, 1.5, n_steps + 1)[1:]:
        truth = radius_m * math.sin(angle), radius_m * (1.0 - math.cos(angle)), float(angle)
        odometry.follow(truth)
    turned = 1.5 * (1.0 + 0.1 * np.random.default_rng(1).standard_normal(2)[1])
    believed_m = radius_m * 1.5 / turned
    expected = believed_m * math.sin(turned), believed_m * (1.0 - math.cos(turned)), turned
    assert abs(turned - 1.5) > 0.05
    assert odometry.pose == pytest.approx(expected, abs=1e-3)


def test_turn_noise_grows_with_the_root_of_the_way():
    settings = OdometrySettings(turn_noise_rad=0.02)
    rngs = [np.random.default_rng(seed) for seed in range(200)]
    yaws = [straight(Odometry(settings, (0.0, 0.0, 0.0), rng), 200)[2] for rng in rngs]
    assert np.std(yaws) == pytest.approx(0.02 * math.sqrt(10.0), rel=0.15)
