"""The dynamic window planner: arrives, waits, keeps off walls and people, obeys the window."""

import math
import time

import numpy as np
import pytest

from serd_core.errors import SerdError
from serd_core.grid import Action
from sim.command import STOP, Command
from sim.decision import waypoint_of_intent
from sim.dwa import DwaPlanner
from sim.dwa_settings import DwaSettings, reachable_window
from sim.observation import make_observation
from sim.planners import make_planner
from sim.rollouts import roll_out
from sim.scenario import load_scenario
from sim.scenario_grid import grid_of
from sim.unicycle import chord_velocity, limited_velocity
from sim.waypoint import Waypoint

HALLWAY = load_scenario("hallway")
PLANNER = DwaPlanner(HALLWAY)


def seen(pose, *, speed=0.0, turn=0.0, people=(), velocity=()):
    return make_observation(
        time_s=0.0,
        tick=0,
        pose=pose,
        speed_mps=speed,
        yaw_rate_radps=turn,
        people_position_m=np.array(people, float).reshape(-1, 2),
        people_velocity_mps=np.array(velocity, float).reshape(-1, 2),
        people_id=np.arange(len(people)),
    )


def drive(pose, waypoint, n_ticks, people=()):
    """Ideal robot without a world: poses (n, 3) and speeds (n,) under the planner's commands."""
    speed = turn = 0.0
    poses, speeds = [], []
    for _ in range(n_ticks):
        observation = seen(
            pose, speed=speed, turn=turn, people=people, velocity=np.zeros_like(people)
        )
        command = PLANNER.step(observation, waypoint)
        speed, turn = limited_velocity(command, speed, turn, HALLWAY.robot, 0.05)
        vx, vy = chord_velocity(pose[2], speed, turn, 0.05)
        pose = (pose[0] + 0.05 * vx, pose[1] + 0.05 * vy, pose[2] + 0.05 * turn)
        poses.append(pose)
        speeds.append(speed)
    return np.array(poses), np.array(speeds)


@pytest.mark.parametrize("yaw_rad", np.linspace(-math.pi, math.pi, 9))
@pytest.mark.parametrize("start", [(2.5, 8.5), (2.1, 8.1), (2.9, 8.1), (0.4, 8.6)])
def test_an_unhindered_robot_is_in_the_next_cell_after_a_decision_period(start, yaw_rad):
    grid = grid_of(HALLWAY)
    observation = seen((*start, yaw_rad))
    waypoint = waypoint_of_intent(grid, observation, Action.NORTH)
    poses, _ = drive(observation.pose, waypoint, HALLWAY.ticks_per_decision)
    wanted = grid.neighbours[grid.state_at(*start), Action.NORTH]
    assert grid.state_at(*poses[-1, :2]) == wanted


def test_without_a_waypoint_or_at_the_waypoint_the_robot_stands_still():
    observation = seen((2.0, 5.0, 1.0), speed=0.5)
    assert PLANNER.step(observation, None) == STOP
    assert PLANNER.step(observation, Waypoint(2.0, 5.0)) == STOP


def test_the_robot_stops_at_the_waypoint_and_stays():
    poses, speeds = drive((2.0, 5.0, 0.0), Waypoint(3.5, 5.0), 100)
    assert np.abs(speeds[-10:]).max() < 1e-9
    assert np.hypot(*(poses[-1, :2] - [3.5, 5.0])) < 0.12


@pytest.mark.parametrize("yaw_rad", [0.0, 0.3, math.pi / 2])
def test_a_waypoint_behind_a_wall_never_makes_the_robot_touch_it(yaw_rad):
    poses, _ = drive((5.0, 8.0, yaw_rad), Waypoint(7.5, 8.0), 100)
    assert poses[:, 0].max() < 6.0 - HALLWAY.robot.radius_m


def test_a_standing_person_in_the_way_is_never_touched_and_is_passed():
    person = (3.0, 8.0)
    poses, _ = drive((1.5, 8.0, 0.0), Waypoint(4.5, 8.0), 160, people=[person])
    gap = np.hypot(*(poses[:, :2] - person).T) - 0.5
    assert gap.min() > 0.0
    assert np.hypot(*(poses[-1, :2] - [4.5, 8.0])) < 0.15


def test_a_wall_of_standing_people_makes_the_robot_wait_in_front_of_it():
    row = [(3.0, y) for y in np.arange(0.2, 16.0, 0.55)]
    poses, speeds = drive((1.5, 8.0, 0.0), Waypoint(4.5, 8.0), 100, people=row)
    assert poses[:, 0].max() < 2.5
    assert np.abs(speeds[-20:]).max() < 0.3


def test_a_person_who_leans_on_the_robot_does_not_keep_it_from_leaving():
    observation = seen((2.0, 8.0, 0.0), people=[(1.55, 8.0)], velocity=[(0.2, 0.0)])
    assert PLANNER.step(observation, Waypoint(4.0, 8.0)).linear_mps > 0.2


def test_the_window_holds_what_the_accelerations_allow():
    window = reachable_window(HALLWAY.robot, 0.5, 1.0, 0.1)
    assert (window.slowest_mps, window.fastest_mps) == pytest.approx((0.25, 0.75))
    assert (window.rightmost_radps, window.leftmost_radps) == pytest.approx((-0.2, 2.2))


def test_rollouts_end_where_the_limited_unicycle_ends():
    time_s = 0.05 * np.arange(1, 21)
    rollouts = roll_out(
        (1.0, 2.0, 0.3),
        (0.2, np.array([1.0])),
        (0.0, np.array([-2.0])),
        HALLWAY.robot,
        time_s,
        turn_time_s=2.0,
    )
    expected, _ = _constant_command((1.0, 2.0, 0.3), 0.2, 1.0, -2.0)
    assert rollouts.x_m[0, 0, -1] == pytest.approx(expected[0], abs=0.04)
    assert rollouts.y_m[0, 0, -1] == pytest.approx(expected[1], abs=0.04)


def _constant_command(pose, speed, wanted_speed, wanted_turn):
    turn = 0.0
    for _ in range(20):
        speed, turn = limited_velocity(
            Command(wanted_speed, wanted_turn), speed, turn, HALLWAY.robot, 0.05
        )
        vx, vy = chord_velocity(pose[2], speed, turn, 0.05)
        pose = (pose[0] + 0.05 * vx, pose[1] + 0.05 * vy, pose[2] + 0.05 * turn)
    return pose, speed


def test_planning_among_24_people_takes_a_few_milliseconds_at_most():
    rng = np.random.default_rng(1)
    people = rng.uniform((0, 6), (6, 12), (24, 2))
    observation = seen((3.0, 9.0, 0.0), people=people, velocity=rng.normal(0, 1, (24, 2)))
    started = time.perf_counter()
    for _ in range(50):
        PLANNER.step(observation, Waypoint(3.5, 10.5))
    assert (time.perf_counter() - started) / 50 < 0.02


def test_settings_out_of_range_are_refused_with_the_fix():
    with pytest.raises(SerdError, match="vx_samples must be at least 3, got 1"):
        DwaSettings(vx_samples=1)


def test_a_wrong_planner_name_is_refused_with_the_nearest_right_one():
    with pytest.raises(SerdError, match="did you mean 'dwa'"):
        make_planner("dwb", HALLWAY)
