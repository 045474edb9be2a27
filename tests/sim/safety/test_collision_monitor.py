"""The collision monitor: a robot that obeys it never touches what it could avoid."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from serd_sim.safety.collision_monitor import CollisionMonitor, Obstacles
from serd_sim.safety.motion import compose, in_frame, motion_between
from serd_sim.safety.reasons import Fault, GuardAction, Reason, Source
from serd_sim.safety.settings import GuardSettings
from serd_sim.scenario.scenario import load_scenario
from serd_sim.scenario.settings import RobotSettings
from serd_sim.world.command import Command, limited_velocity

ROBOT, STEP_S = RobotSettings(), 0.05
SETTINGS = GuardSettings(decel_lim_x=ROBOT.decel_lim_x_mps2)
FORWARD = Command(1.2, 0.0)


def obstacles(points=(), people=(), velocities=None):
    people = np.array(people, dtype=float).reshape(-1, 2)
    velocities = np.zeros_like(people) if velocities is None else np.array(velocities, dtype=float)
    return Obstacles(np.array(points, dtype=float).reshape(-1, 2), people, velocities)


def wall_ahead(distance_m, half_width_m=1.0):
    across = np.arange(-half_width_m, half_width_m, 0.02)
    return np.stack([np.full_like(across, distance_m), across], axis=1)


class Robot:
    """A unicycle with the limits of the robot, as the world drives it."""

    def __init__(self, speed_mps=0.0, yaw_rate_radps=0.0):
        self.pose = (0.0, 0.0, 0.0)
        self.speeds = (speed_mps, yaw_rate_radps)

    def drive(self, command):
        self.speeds = speed, turn = limited_velocity(command, *self.speeds, ROBOT, STEP_S)
        x_m, y_m, yaw_rad = self.pose
        middle = yaw_rad + 0.5 * turn * STEP_S
        self.pose = (
            x_m + speed * STEP_S * math.cos(middle),
            y_m + speed * STEP_S * math.sin(middle),
            yaw_rad + turn * STEP_S,
        )


commands = st.builds(Command, st.floats(-0.3, 1.2), st.floats(-3.5, 3.5))
places = st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))


poses = st.tuples(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0), st.floats(-3.1, 3.1))


@given(start=poses, end=poses)
def test_a_pose_and_the_motion_from_it_give_the_pose_of_the_end(start, end):
    motion = motion_between(start, end)
    assert compose(start, motion) == pytest.approx(end, abs=1e-9)
    assert in_frame(np.array([end[:2]]), start)[0] == pytest.approx(motion[:2], abs=1e-9)


def test_a_slow_lidar_leaves_the_guard_time_to_slow_down_before_a_scan_is_old():
    """At 2 Hz two scans are expected within 1.25 s; the robot drives slower from 0.75 s on."""
    slow = load_scenario("hallway").with_values("lidar", rate_hz=2.0)
    settings = GuardSettings.of_scenario(slow)
    assert (settings.source_timeout, settings.slowdown_timeout) == pytest.approx((1.25, 0.75))


@given(
    points=st.lists(places.filter(lambda p: math.hypot(*p) > 0.28), min_size=1, max_size=6),
    wanted=st.lists(commands, min_size=1, max_size=8),
)
def test_a_robot_from_rest_touches_no_static_obstacle_whatever_is_commanded(points, wanted):
    monitor = CollisionMonitor(SETTINGS.model_copy(update={"min_points": 1}))
    world_m, robot = np.array(points), Robot()
    for command in wanted:
        for _ in range(12):
            seen = obstacles(in_frame(world_m, robot.pose))
            robot.drive(monitor.step(command, robot.speeds, seen)[0])
            gap_m = np.hypot(*(world_m - np.array(robot.pose[:2])).T).min() - ROBOT.radius_m
            assert gap_m > 0.0


@given(distance_m=st.floats(0.25, 1.5), command=commands)
def test_it_intervenes_only_where_braking_one_period_later_would_be_too_late(distance_m, command):
    """The least restrictive monitor: what it allows and forbids is decided by the braking path."""
    robot = Robot(speed_mps=0.8)
    done = CollisionMonitor(SETTINGS).step(command, robot.speeds, obstacles(wall_ahead(distance_m)))
    for _ in range(2):  # one period and the reaction time
        robot.drive(command)
    while robot.speeds[0] != 0.0:
        robot.drive(Command(0.0, 0.0))
    if robot.pose[0] + SETTINGS.radius + SETTINGS.collision_margin < distance_m - 1e-3:
        assert done == (command, GuardAction.DO_NOTHING, ())


@pytest.mark.parametrize("gap_m", [-0.05, 0.0, 0.01])
def test_a_robot_that_touches_something_may_turn_and_drive_away_but_not_into_it(gap_m):
    seen = obstacles(wall_ahead(0.25 + gap_m), people=[(0.5 + gap_m, 0.0)])
    monitor = CollisionMonitor(SETTINGS)
    for command in (Command(-0.3, 0.0), Command(0.0, 2.0), Command(-0.2, 1.0)):
        assert monitor.step(command, (0.0, 0.0), seen)[0] == command
    command, action, _ = monitor.step(Command(0.5, 1.0), (0.0, 0.0), obstacles(wall_ahead(0.25)))
    assert (command, action) == (Command(0.0, 1.0), GuardAction.STOP)


@pytest.mark.parametrize(("side", "passes"), [(1.0, False), (-1.0, True)])
def test_an_obstacle_on_the_inner_side_of_a_turn_slows_the_robot_and_one_outside_does_not(
    side, passes
):
    turn, seen = Command(0.8, 3.0), obstacles([(0.3, 0.2 * side), (0.3, 0.21 * side)])
    command, _, _ = CollisionMonitor(SETTINGS).step(turn, (0.8, 3.0), seen)
    assert (command == turn) == passes


def test_a_robot_may_follow_a_wall_that_is_nearer_than_the_margin():
    along = np.arange(-2.0, 2.0, 0.02)
    wall_m = np.stack([along, np.full_like(along, 0.26)], axis=1)
    assert CollisionMonitor(SETTINGS).step(FORWARD, (1.0, 0.0), obstacles(wall_m))[0] == FORWARD


def test_a_person_who_walks_away_is_followed_and_one_who_comes_is_not():
    monitor, ahead = CollisionMonitor(SETTINGS), [(0.9, 0.0)]
    away = obstacles(people=ahead, velocities=[(1.2, 0.0)])
    towards = obstacles(people=ahead, velocities=[(-1.2, 0.0)])
    assert monitor.step(FORWARD, (1.0, 0.0), away)[0] == FORWARD
    command, _, reasons = monitor.step(FORWARD, (1.0, 0.0), towards)
    assert command.linear_mps < 1.2
    assert reasons == (Reason(Source.PEOPLE, Fault.COLLISION),)
    behind = obstacles(people=[(-0.45, 0.0)], velocities=[(1.5, 0.0)])
    assert monitor.step(FORWARD, (0.0, 0.0), behind)[0] == FORWARD, "it leaves who runs into it"


@pytest.mark.parametrize(
    ("points_m", "points_mps", "passes"),
    [(wall_ahead(0.5), 0.0, True), (wall_ahead(0.5), 1.3, False), (wall_ahead(0.8), 1.3, True),
     (-wall_ahead(0.4), 1.3, True)],
)  # fmt: skip
def test_points_that_may_come_nearer_keep_the_robot_further_away(points_m, points_mps, passes):
    """Until a robot at 0.5 m/s stands, 0.2 s later, a person comes 0.26 m nearer."""
    seen = replace(obstacles(points_m), points_mps=points_mps)
    command = CollisionMonitor(SETTINGS).step(Command(0.5, 0.0), (0.5, 0.0), seen)[0]
    assert (command.linear_mps == 0.5) == passes


def test_single_points_are_no_obstacle_where_more_are_wanted():
    seen = obstacles([(0.34, 0.0)])
    assert CollisionMonitor(SETTINGS).step(FORWARD, (0.5, 0.0), seen)[0] == FORWARD
    strict = SETTINGS.model_copy(update={"min_points": 1})
    assert CollisionMonitor(strict).step(FORWARD, (0.5, 0.0), seen)[0] != FORWARD


def test_the_slowdown_zone_halves_a_command_and_the_stop_zone_forbids_to_come_nearer():
    seen = obstacles([(0.7, 0.0), (0.7, 0.01)])
    slow = CollisionMonitor(SETTINGS.model_copy(update={"slowdown_radius": 0.8}))
    near = (Reason(Source.SCAN, Fault.NEAR),)
    slowed = Command(0.1, 0.2), GuardAction.SLOWDOWN, near
    assert slow.step(Command(0.2, 0.4), (0.1, 0.0), seen) == slowed
    stop = CollisionMonitor(SETTINGS.model_copy(update={"stop_radius": 0.8}))
    assert stop.step(Command(0.2, 0.4), (0.0, 0.0), seen)[0] == Command(0.0, 0.4)
    assert stop.step(Command(-0.2, 0.0), (0.0, 0.0), seen)[0] == Command(-0.2, 0.0)
