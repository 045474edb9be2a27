"""Stopping: speeds, distances and times against the closed form of constant deceleration."""

import numpy as np
import pytest

from serd_core.errors import SerdError
from serd_sim.planning.catalogue import make_planner
from serd_sim.planning.rollouts import before_stop, require_foresight, speed_to_stop_within
from serd_sim.scenario.scenario import load_scenario
from serd_sim.scenario.settings import RobotSettings
from serd_sim.world.waypoint import Waypoint
from support.observations import observation_at

ROBOT = RobotSettings(acc_lim_x_mps2=2.0, max_vel_x_mps=1.0)
TIME_S = np.arange(1, 11) / 10.0


@pytest.mark.parametrize("distance_m", [0.01, 0.1, 1.0, 4.0])
def test_a_robot_that_brakes_with_seven_tenths_of_its_deceleration_stops_at_the_distance(
    distance_m,
):
    """v^2 = 2 * 0.7 a d."""
    speed = speed_to_stop_within(distance_m, ROBOT)
    assert speed**2 / (2 * 0.7 * ROBOT.acc_lim_x_mps2) == pytest.approx(distance_m)


def test_planners_are_no_faster_than_they_can_stop_at_the_waypoint():
    """dwa samples even shares of that speed; mppi clips the speeds of its plans at it."""
    hallway = load_scenario("hallway").with_pedestrian_count(0)
    limit_mps = speed_to_stop_within(0.12, hallway.robot)
    ahead = Waypoint(3.12, 8.0)
    sampled = make_planner("dwa", hallway).step(observation_at(3.0, 8.0), ahead).linear_mps
    assert sampled == pytest.approx(limit_mps / (hallway.local_planner.vx_samples - 2))
    fast = observation_at(3.0, 8.0, speed_mps=1.1)
    assert make_planner("mppi", hallway).step(fast, ahead).linear_mps == pytest.approx(limit_mps)


def test_only_the_times_before_the_robot_has_stopped_are_given():
    """From 1 m/s at 2 m/s2 it stops in 0.5 s, after 0.3 s of reaction; slow robots stand."""
    before = before_stop(np.array([1.0, 0.4, -0.4, 0.01]), ROBOT, TIME_S, slowest_mps=0.02)
    assert before.shape == (4, 8)
    assert before.sum(axis=1).tolist() == [8, 5, 5, 0]
    assert (
        before_stop(np.array([1.0]), ROBOT, TIME_S, slowest_mps=0.0, reaction_s=0.0).shape[1] == 5
    )
    assert before_stop(np.array([0.0]), ROBOT, TIME_S, slowest_mps=0.0).shape == (1, 0)


def test_a_horizon_of_exactly_the_stopping_time_is_enough():
    require_foresight("horizon", 0.8, ROBOT)
    with pytest.raises(
        SerdError, match=r"horizon must be at least 0\.8 s, .* got 0\.79 s; raise it"
    ):
        require_foresight("horizon", 0.79, ROBOT)
