"""The dynamic window and the rollouts, against closed forms and the limited unicycle."""

import math

import numpy as np
import pytest

from serd_core.errors import SerdError
from serd_sim.planning.dwa import (
    before_stop,
    reachable_window,
    require_foresight,
    roll_out,
    speed_to_stop_within,
)
from serd_sim.planning.local_planner import make_planner
from serd_sim.scenario.scenario import load_scenario
from serd_sim.scenario.settings import RobotSettings
from serd_sim.world.waypoint import Waypoint
from support.observations import observation_at

ROBOT = RobotSettings()
SLOW = RobotSettings(acc_lim_x_mps2=2.0, acc_lim_theta_radps2=4.0)
POSE = (1.0, 2.0, 0.3)
TIME_S = 0.05 * np.arange(1, 21)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_window_holds_what_the_accelerations_allow_up_to_the_limits_of_the_robot(sign):
    speeds, turns = reachable_window(ROBOT, 0.5, sign * 1.0, 0.1)
    assert speeds == pytest.approx((0.25, 0.75))
    assert turns == pytest.approx((sign - 1.2, sign + 1.2))
    speeds, turns = reachable_window(ROBOT, sign * 0.5, sign * 3.0, 10.0)
    assert speeds == (ROBOT.min_vel_x_mps, ROBOT.max_vel_x_mps)
    assert turns == (-ROBOT.max_vel_theta_radps, ROBOT.max_vel_theta_radps)


@pytest.mark.parametrize("start_s", [0.0, 0.25])
def test_straight_rollouts_cover_the_distance_of_constant_acceleration(start_s):
    """From 0.2 m/s to 1 m/s at 2 m/s2; the ramp ends with a step, so midpoints are exact."""
    rollouts = roll_out(
        POSE, (0.2, np.array([1.0, 0.2])), (0.0, np.zeros(1)), SLOW, TIME_S, 2.0, start_s
    )
    ramp_s = np.clip(TIME_S - start_s, 0.0, 0.4)
    after_s = np.maximum(TIME_S - start_s - 0.4, 0.0)
    way_m = 0.2 * np.minimum(TIME_S, start_s) + 0.2 * ramp_s + ramp_s**2 + 1.0 * after_s
    for index, expected_m in enumerate([way_m, 0.2 * TIME_S]):
        np.testing.assert_allclose(rollouts.x_m[index, 0], 1.0 + expected_m * math.cos(0.3))
        np.testing.assert_allclose(rollouts.y_m[index, 0], 2.0 + expected_m * math.sin(0.3))
    np.testing.assert_allclose(rollouts.yaw_rad, np.full((1, 20), 0.3))


def test_the_yaw_is_that_of_constant_acceleration_up_to_the_turn_time_and_constant_then():
    """From 0 to 1.2 rad/s at 4 rad/s2 within 0.3 s; it turns for 0.5 s, then drives straight."""
    rollouts = roll_out(POSE, (0.0, np.zeros(1)), (0.0, np.array([1.2, -1.2])), SLOW, TIME_S, 0.5)
    turning_s = np.minimum(TIME_S, 0.5)
    ramp_s = np.minimum(turning_s, 0.3)
    turned_rad = 2.0 * ramp_s**2 + 1.2 * (turning_s - ramp_s)
    np.testing.assert_allclose(rollouts.yaw_rad, [0.3 + turned_rad, 0.3 - turned_rad])
    # The turn lasts up to a midpoint that is the turn time.
    time_s = np.array([0.5, 1.0, 1.5])
    rollouts = roll_out(POSE, (0.0, np.zeros(1)), (1.0, np.ones(1)), SLOW, time_s, turn_time_s=0.75)
    np.testing.assert_allclose(rollouts.yaw_rad[0], 0.3 + np.array([0.5, 1.0, 1.0]))


def test_a_steady_rollout_keeps_the_circle_of_its_chords():
    """Points of equal steps of s and turns of h lie on a circle of radius s / (2 sin(h / 2))."""
    speed, turn, step_s = 0.8, 1.5, 0.05
    rollouts = roll_out(
        POSE, (speed, np.array([speed])), (turn, np.array([turn])), ROBOT, TIME_S, turn_time_s=2.0
    )
    radius_m = 0.5 * speed * step_s / math.sin(0.5 * turn * step_s)
    yaw = 0.3 + turn * TIME_S
    np.testing.assert_allclose(rollouts.speed_mps, np.full((1, 20), speed))
    np.testing.assert_allclose(rollouts.yaw_rad[0], yaw)
    np.testing.assert_allclose(rollouts.x_m[0, 0], 1.0 + radius_m * (np.sin(yaw) - math.sin(0.3)))
    np.testing.assert_allclose(rollouts.y_m[0, 0], 2.0 - radius_m * (np.cos(yaw) - math.cos(0.3)))


def test_each_speed_is_combined_with_each_turn():
    speeds, turns = np.array([0.1, 0.6, 0.9]), np.array([-1.0, 0.7])
    together = roll_out(POSE, (0.3, speeds), (0.5, turns), ROBOT, TIME_S, 0.4, 0.1)
    assert together.x_m.shape == together.y_m.shape == (3, 2, 20)
    assert (together.speed_mps.shape, together.yaw_rad.shape) == ((3, 20), (2, 20))
    for i, j in np.ndindex(3, 2):
        one = (0.3, speeds[i : i + 1]), (0.5, turns[j : j + 1])
        alone = roll_out(POSE, *one, ROBOT, TIME_S, 0.4, 0.1)
        np.testing.assert_array_equal(together.x_m[i, j], alone.x_m[0, 0])
        np.testing.assert_array_equal(together.y_m[i, j], alone.y_m[0, 0])


STOPPING = RobotSettings(acc_lim_x_mps2=2.0, max_vel_x_mps=1.0)
TENTHS_S = np.arange(1, 11) / 10.0


def test_the_planner_is_no_faster_than_it_can_stop_at_the_waypoint():
    """v^2 = 2 * 0.7 a d; samples are even shares of that speed."""
    for distance_m in (0.01, 4.0):
        speed_mps = speed_to_stop_within(distance_m, STOPPING)
        assert speed_mps**2 / (2 * 0.7 * STOPPING.acc_lim_x_mps2) == pytest.approx(distance_m)
    hallway = load_scenario("hallway").with_pedestrian_count(0)
    limit_mps = speed_to_stop_within(0.12, hallway.robot)
    ahead = Waypoint(3.12, 8.0)
    sampled = make_planner(hallway).step(observation_at(3.0, 8.0), ahead).linear_mps
    assert sampled == pytest.approx(limit_mps / (hallway.local_planner.vx_samples - 2))


def test_only_the_times_before_the_robot_has_stopped_are_given():
    """From 1 m/s at 2 m/s2 it stops in 0.5 s, after 0.3 s of reaction; slow robots stand."""
    before = before_stop(np.array([1.0, 0.4, -0.4, 0.01]), STOPPING, TENTHS_S, slowest_mps=0.02)
    assert before.shape == (4, 8)
    assert before.sum(axis=1).tolist() == [8, 5, 5, 0]
    at_once = before_stop(np.array([1.0]), STOPPING, TENTHS_S, slowest_mps=0.0, reaction_s=0.0)
    assert at_once.shape[1] == 5
    assert before_stop(np.array([0.0]), STOPPING, TENTHS_S, slowest_mps=0.0).shape == (1, 0)


def test_a_horizon_of_exactly_the_stopping_time_is_enough():
    require_foresight("horizon", 0.8, STOPPING)
    with pytest.raises(
        SerdError, match=r"horizon must be at least 0\.8 s, .* got 0\.79 s; raise it"
    ):
        require_foresight("horizon", 0.79, STOPPING)
