"""Laws every planner keeps whatever it sees, and the aims of the closed loop."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from serd_sim.episodes.batch import EpisodeTask, run_task
from serd_sim.planning.catalogue import make_planner, planner_names
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.waypoint import Waypoint
from support.observations import observation_at

HALLWAY = load_scenario("hallway")
PLANNERS = {name: make_planner(name, HALLWAY) for name in planner_names()}

finite = st.floats(-2.0, 2.0)


@pytest.mark.parametrize("name", planner_names())
@settings(max_examples=60, deadline=None)
@given(
    x_m=st.floats(0.3, 5.7),
    y_m=st.floats(0.3, 23.7),
    yaw_rad=st.floats(-math.pi, math.pi),
    speed=st.floats(-0.3, 1.2),
    turn=st.floats(-3.5, 3.5),
    people=st.lists(st.tuples(finite, finite, finite, finite), max_size=12),
    to=st.tuples(finite, finite),
)
def test_whatever_is_seen_the_command_is_finite_and_within_the_robots_limits(
    name, x_m, y_m, yaw_rad, speed, turn, people, to
):
    rows = np.array(people, dtype=float).reshape(-1, 4)
    observation = observation_at(
        x_m,
        y_m,
        yaw_rad,
        speed_mps=speed,
        yaw_rate_radps=turn,
        people=rows[:, :2] + (x_m, y_m),
        velocity=rows[:, 2:],
    )
    command = PLANNERS[name].step(observation, Waypoint(x_m + to[0], y_m + to[1]))
    robot = HALLWAY.robot
    assert command.is_finite
    assert robot.min_vel_x_mps <= command.linear_mps <= robot.max_vel_x_mps + 1e-9
    assert abs(command.angular_radps) <= robot.max_vel_theta_radps + 1e-9


@pytest.mark.parametrize("name", planner_names())
@pytest.mark.parametrize("n_people", [30, 60])
@pytest.mark.parametrize("driver", ["expert_with_flow", "expert_against_flow"])
def test_the_robot_arrives_among_many_people_and_drives_into_nobody_with_the_flow(
    name, n_people, driver
):
    row = run_task(EpisodeTask("crossing", 3, n_people=n_people, planner=name, driver=driver))
    assert row["outcome"] == "arrived"
    assert row["robot_on_wall"] == 0
    if driver == "expert_with_flow":
        assert row["robot_on_person"] == 0
