"""What every local planner must do: arrive, wait, keep off walls and people, repeat itself."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from serd_core.grid.grid import Action
from serd_sim.episodes.batch import EpisodeTask, run_task
from serd_sim.planning.local_planner import make_planner
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import load_scenario
from serd_sim.scenario.settings import Obstacle
from serd_sim.world.command import STOP, chord_velocity, limited_velocity
from serd_sim.world.waypoint import Waypoint, waypoint_of_intent
from support.observations import observation_at

HALLWAY = load_scenario("hallway")
GRID = grid_of(HALLWAY)


@pytest.fixture
def planner():
    return make_planner(HALLWAY)


def drive(planner, pose, waypoint, n_ticks, people=()):
    """Ideal robot without a world: poses (n, 3) and speeds (n,) under the planner's commands."""
    speed = turn = 0.0
    poses, speeds = [], []
    for _ in range(n_ticks):
        observation = observation_at(*pose, speed_mps=speed, yaw_rate_radps=turn, people=people)
        command = planner.step(observation, waypoint)
        speed, turn = limited_velocity(command, speed, turn, HALLWAY.robot, 0.05)
        vx, vy = chord_velocity(pose[2], speed, turn, 0.05)
        pose = (pose[0] + 0.05 * vx, pose[1] + 0.05 * vy, pose[2] + 0.05 * turn)
        poses.append(pose)
        speeds.append(speed)
    return np.array(poses), np.array(speeds)


@pytest.mark.parametrize(
    ("start", "yaw_rad"),
    [((2.1, 8.1), -math.pi), ((2.9, 8.1), -math.pi / 2), ((0.4, 8.6), 0.0), ((2.1, 8.1), 1.6)],
)
def test_an_unhindered_robot_passes_the_next_cell_within_its_patience(planner, start, yaw_rad):
    """Near a border it may swing into the cell beside it first, where it faces that way."""
    observation = observation_at(*start, yaw_rad)
    waypoint = waypoint_of_intent(GRID, observation, Action.NORTH)
    poses, _ = drive(planner, observation.pose, waypoint, round(HALLWAY.patience_s / 0.05))
    wanted = GRID.neighbours[GRID.state_at(*start), Action.NORTH]
    assert wanted in GRID.states_at(poses[:, :2])


def test_a_robot_passes_the_corner_of_a_table_in_cells_that_it_nearly_fills():
    """Cells of 0.24 m, a robot of 0.21 m; the next cell is 3 mm from the table."""
    table = Obstacle(name="table", outline_m=((2.0, 0.7), (2.6, 0.7), (2.6, 1.7), (2.0, 1.7)))
    robot = HALLWAY.robot.model_copy(update={"radius_m": 0.105, "max_vel_x_mps": 0.4})
    changes = {"cell_size_m": 0.24, "robot": robot, "obstacles": (table,)}
    planner = make_planner(HALLWAY.model_copy(update=changes))
    poses, _ = drive(planner, (1.843, 0.605, -0.4), Waypoint(2.28, 0.6), 60)
    assert math.dist(poses[-1, :2], (2.28, 0.6)) < 0.12
    assert np.hypot(*(poses[:, :2] - (2.0, 0.7)).T).min() > robot.radius_m


def test_the_robot_stops_at_the_waypoint_and_drives_the_same_after_a_reset(planner):
    observation = observation_at(2.0, 5.0, 1.0, speed_mps=0.5)
    assert planner.step(observation, None) == planner.step(observation, Waypoint(2.0, 5.0)) == STOP
    drives = []
    for _ in range(2):
        planner.reset()
        drives.append(drive(planner, (2.0, 5.0, 0.0), Waypoint(3.5, 5.0), 100))
    (poses, speeds), (again, _) = drives
    np.testing.assert_array_equal(again, poses)
    assert np.abs(speeds[-10:]).max() < 1e-9
    assert np.hypot(*(poses[-1, :2] - [3.5, 5.0])) < 0.12


@pytest.mark.parametrize("yaw_rad", [0.3, math.pi / 2])
def test_a_waypoint_behind_a_wall_never_makes_the_robot_touch_it(planner, yaw_rad):
    poses, _ = drive(planner, (5.0, 8.0, yaw_rad), Waypoint(7.5, 8.0), 100)
    assert poses[:, 0].max() < 6.0 - HALLWAY.robot.radius_m


def test_a_standing_person_in_the_way_is_never_touched_and_is_passed(planner):
    person = (3.0, 8.0)
    poses, _ = drive(planner, (1.5, 8.0, 0.0), Waypoint(4.5, 8.0), 160, people=[person])
    gap = np.hypot(*(poses[:, :2] - person).T) - 0.5
    assert gap.min() > 0.0
    assert np.hypot(*(poses[-1, :2] - [4.5, 8.0])) < 0.15


def test_a_wall_of_standing_people_makes_the_robot_wait_in_front_of_it(planner):
    row = [(3.0, y) for y in np.arange(0.2, 16.0, 0.55)]
    poses, speeds = drive(planner, (1.5, 8.0, 0.0), Waypoint(4.5, 8.0), 100, people=row)
    assert poses[:, 0].max() < 2.5
    assert np.abs(speeds[-20:]).max() < 0.3


def test_a_person_who_leans_on_the_robot_does_not_keep_it_from_leaving(planner):
    observation = observation_at(2.0, 8.0, 0.0, people=[(1.55, 8.0)], velocity=[(0.2, 0.0)])
    assert planner.step(observation, Waypoint(4.0, 8.0)).linear_mps > 0.1


def test_a_person_without_a_finite_velocity_is_driven_round_as_one_who_stands(planner):
    people, commands = [(3.0, 8.0), (5.0, 4.0)], []
    for more, velocity in (([], None), ([], [(math.nan, 0), (0, 0)]), ([(math.nan, 8.0)], None)):
        planner.reset()
        seen = observation_at(1.9, 8.0, 0.0, speed_mps=0.8, people=people + more, velocity=velocity)
        commands.append(planner.step(seen, Waypoint(4.5, 8.0)))
    assert commands[0] == commands[1] == commands[2]


PLANNER = make_planner(HALLWAY)


@settings(max_examples=40)
@given(
    place=st.tuples(st.floats(0.3, 5.7), st.floats(0.3, 23.7), st.floats(-math.pi, math.pi)),
    speeds=st.tuples(st.floats(-0.3, 1.2), st.floats(-3.5, 3.5)),
    people=st.lists(st.tuples(*[st.floats(-2.0, 2.0)] * 4), max_size=12),
    to=st.tuples(*[st.floats(-2.0, 2.0)] * 2),
)
def test_whatever_is_seen_the_command_is_finite_and_within_the_robots_limits(
    place, speeds, people, to
):
    rows = np.array(people, dtype=float).reshape(-1, 4)
    motion = dict(zip(("speed_mps", "yaw_rate_radps"), speeds, strict=True))
    seen = observation_at(*place, **motion, people=rows[:, :2] + place[:2], velocity=rows[:, 2:])
    command = PLANNER.step(seen, Waypoint(place[0] + to[0], place[1] + to[1]))
    robot = HALLWAY.robot
    assert command.is_finite
    assert robot.min_vel_x_mps <= command.linear_mps <= robot.max_vel_x_mps + 1e-9
    assert abs(command.angular_radps) <= robot.max_vel_theta_radps + 1e-9


def test_the_robot_arrives_among_many_people_against_the_flow():
    row = run_task(EpisodeTask("crossing", 3, n_people=60, driver="expert_against_flow"))
    assert row["outcome"] == "arrived"
    assert row["robot_on_wall"] == 0
