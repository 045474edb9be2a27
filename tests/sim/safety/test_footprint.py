"""Robots that are not round: no part of the outline meets what the guard knows of."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from shapely import Polygon, points
from shapely.affinity import rotate, translate

from serd_sim.robot.footprint import footprint_of
from serd_sim.safety.collision_monitor import CollisionMonitor, Obstacles
from serd_sim.safety.guard import Guard
from serd_sim.safety.motion import in_frame
from serd_sim.safety.reasons import GuardAction
from serd_sim.safety.scan import Scan, ScanGeometry
from serd_sim.safety.settings import GuardSettings
from serd_sim.scenario.settings import RobotSettings
from serd_sim.world.command import Command, limited_velocity
from support.corridor import Corridor

BOX = "[[0.5, 0.3], [-0.5, 0.3], [-0.5, -0.3], [0.5, -0.3]]"
#: The centre is at the rear axle, and the outline is not convex.
FORK = (
    "[[1.0, 0.4], [1.0, 0.2], [0.1, 0.2], [0.1, -0.2],"
    " [1.0, -0.2], [1.0, -0.4], [-0.3, -0.4], [-0.3, 0.4]]"
)
STEP_S, ROBOT = 0.05, RobotSettings(min_vel_x_mps=-1.2)
NOBODY = np.zeros((0, 2))


def outline(text):
    return Polygon(footprint_of(0.1, text).corners_m)


def placed(text, pose):
    turned = rotate(outline(text), pose[2], origin=(0, 0), use_radians=True)
    return translate(turned, *pose[:2])


def settings(text, **values):
    return GuardSettings(footprint=text, decel_lim_x=ROBOT.decel_lim_x_mps2, min_points=1, **values)


places = st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
poses = st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-3.1, 3.1))


@given(place=places, pose=poses, text=st.sampled_from([BOX, FORK]))
def test_the_gap_is_the_distance_from_the_outline_and_negative_within_it(place, pose, text):
    body, point = placed(text, pose), points([place])[0]
    gap_m = footprint_of(0.1, text).gaps_m(np.array([pose]), np.array([place]))[0, 0]
    assert abs(gap_m) == pytest.approx(body.exterior.distance(point), abs=1e-9)
    assert (gap_m < 0.0) == body.contains(point) or abs(gap_m) < 1e-8


@given(
    world=st.lists(places, min_size=1, max_size=6),
    wanted=st.lists(
        st.builds(Command, st.floats(-1.2, 1.2), st.floats(-3.5, 3.5)), min_size=1, max_size=6
    ),
    text=st.sampled_from([BOX, FORK]),
)
def test_no_corner_sweeps_into_a_static_obstacle_whatever_is_commanded(world, wanted, text):
    world_m = np.array(world)
    world_m = world_m[footprint_of(0.1, text).gap_m(world_m) > 0.02]
    monitor, speeds, pose = CollisionMonitor(settings(text)), (0.0, 0.0), (0.0, 0.0, 0.0)
    for command in wanted:
        for _ in range(10):
            seen = Obstacles(in_frame(world_m, pose), NOBODY, NOBODY)
            allowed = monitor.step(command, speeds, seen)[0]
            speeds = speed, turn = limited_velocity(allowed, *speeds, ROBOT, STEP_S)
            middle = pose[2] + 0.5 * turn * STEP_S
            x_m, y_m = (speed * STEP_S * side(middle) for side in (math.cos, math.sin))
            pose = (pose[0] + x_m, pose[1] + y_m, pose[2] + turn * STEP_S)
            body = placed(text, pose)
            assert not any(body.contains(each) for each in points(world_m))


@pytest.mark.parametrize(("gap_m", "turns"), [(0.05, False), (0.35, True)])
def test_a_long_robot_turns_in_place_only_where_its_corners_have_room(gap_m, turns):
    """The corners reach 0.28 m further to the side than the flanks."""
    along = np.arange(-2.0, 2.0, 0.02)
    seen = Obstacles(np.stack([along, np.full_like(along, 0.3 + gap_m)], axis=1), NOBODY, NOBODY)
    monitor, pose, speeds = CollisionMonitor(settings(BOX)), (0.0, 0.0, 0.0), (0.0, 0.0)
    for _ in range(60):
        now = Obstacles(in_frame(seen.points_m, pose), NOBODY, NOBODY)
        allowed, action, _ = monitor.step(Command(0.0, 2.0), speeds, now)
        speeds = limited_velocity(allowed, *speeds, ROBOT, STEP_S)
        pose = (0.0, 0.0, pose[2] + speeds[1] * STEP_S)
        assert placed(BOX, pose).bounds[3] < 0.3 + gap_m
    assert (pose[2] > math.pi) == turns
    assert (action is GuardAction.STOP) != turns


def test_a_disc_and_a_polygon_of_many_corners_are_stopped_alike():
    angle = np.linspace(0.0, math.tau, 90)[:-1]
    text = str((0.25 * np.stack([np.cos(angle), np.sin(angle)], axis=1)).round(6).tolist())
    disc, polygon = (Corridor(**each).run() for each in ({}, {"footprint": text}))
    assert polygon.pose[0] == pytest.approx(disc.pose[0], abs=0.02)
    assert polygon.faults == disc.faults == {"COLLISION"}


def test_a_return_below_range_min_is_at_the_edge_of_the_polygon():
    """Where nothing shows how near it is: 0.5 m ahead of the centre, 0.3 m aside of it."""
    guard = Guard(settings(BOX, observation_sources=("scan",)))
    ranges = np.full(360, 3.0, dtype=np.float32)
    ranges[[180, 270]] = -np.inf
    guard.advance(0.0)
    guard.receive_odometry(0.0, (0.0, 0.0, 0.0), (0.0, 0.0))
    guard.receive_scan(Scan(0.0, ranges, ScanGeometry(-math.pi, math.tau / 360, 0.1, 5.0)))
    for command, moves in ((Command(0.5, 0.0), False), (Command(-0.5, 0.0), True)):
        guard.receive_command(0.0, command)
        assert (guard.step(0.0).command.linear_mps != 0.0) == moves


def test_what_a_lidar_of_a_half_circle_has_passed_is_remembered_by_a_robot_that_turns():
    corridor = Corridor(
        field_rad=math.pi, n_rays=181, footprint=BOX, sides_m=(-0.45, 0.45), wall_m=9.0
    )
    corridor.run(2.0)
    assert corridor.pose[0] > 1.0
    corridor.run(3.0, Command(0.0, 1.0))
    assert {"NOT_IN_VIEW", "COLLISION"} <= corridor.faults
    assert abs(placed(BOX, corridor.pose).bounds[3]) < 0.45


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("[[0.3, 0.2], [-0.3, 0.2]]", "three or more, got"),
        ("0.3, 0.2", "must be corners as in"),
        ("[[0.3, 0.2], [-0.3", "must be corners as in"),
        ("[[30, 20], [-30, 20], [-30, -20]]", "at most 10 m from the centre"),
        ("[[0.3, .nan], [-0.3, 0.2], [0, 1]]", "must be corners as in"),
        ("[[1, 1], [-1, -1], [1, -1], [-1, 1]]", "cross"),
    ],
)
def test_what_is_no_outline_is_refused(text, sentence):
    with pytest.raises(ValidationError, match=sentence):
        GuardSettings(footprint=text)
    assert GuardSettings(footprint="[]").outline.is_round
