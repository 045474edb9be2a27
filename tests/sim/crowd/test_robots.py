"""How people walk around a robot in their way."""

import dataclasses
import math

import numpy as np
import pytest

from serd_sim.crowd.robots import RobotBody, headings_around
from serd_sim.crowd.social_force import WallGeometry
from tests.sim.crowd.test_social_force import FAR_WALL, crowd_at, walk

CLEARANCE_M, BODY_M, ROBOT_M = 0.2, 0.25, 0.25
CIRCLE_M = CLEARANCE_M + BODY_M + ROBOT_M
EAST = 0.0


def robot_at(x_m, y_m, velocity_x_mps=0.0):
    return RobotBody(x_m, y_m, velocity_x_mps, 0.0, ROBOT_M)


def heading_of_person_at_origin(robot, wanted_rad=EAST, *, walls_m=FAR_WALL, speed_mps=1.3):
    """Direction (rad) in which a person who wants to go in another one goes past the robot."""
    to_m = np.array([robot.x_m]), np.array([robot.y_m]), np.hypot([robot.x_m], [robot.y_m])
    wanted = np.array([math.cos(wanted_rad)]), np.array([math.sin(wanted_rad)])
    walls = WallGeometry(walls_m)
    x, y = headings_around(robot, to_m, wanted, np.array([speed_mps]), walls, BODY_M, CLEARANCE_M)
    assert math.hypot(x[0], y[0]) == pytest.approx(1.0)
    return math.atan2(y[0], x[0])


def wall_at_y(y_m):
    return np.array([[[-50.0, y_m], [50.0, y_m]]])


@pytest.mark.parametrize(("y_m", "side"), [(0.3, -1.0), (-0.3, 1.0)])
def test_the_tangent_leads_past_the_robot_on_the_nearer_side(y_m, side):
    found = heading_of_person_at_origin(robot_at(2.0, y_m))
    away = math.hypot(2.0, y_m)
    assert found == pytest.approx(math.atan2(y_m, 2.0) + side * math.asin(CIRCLE_M / away))


@pytest.mark.parametrize(
    "place", [(-1.0, 0.0), (1.0, CIRCLE_M + 0.01), (CIRCLE_M + 2.01, 0.0), (1.0, 0.0, 1.4)]
)
def test_a_robot_behind_beside_the_way_far_away_or_faster_changes_no_heading(place):
    assert heading_of_person_at_origin(robot_at(*place)) == pytest.approx(EAST)
    slower = robot_at(1.5, 0.0, velocity_x_mps=0.5)
    assert heading_of_person_at_origin(slower) > 0.3, "people overtake it"


def test_people_pass_on_the_other_side_where_a_wall_leaves_no_room():
    robot = robot_at(2.0, 0.3)
    lowest_m = 0.3 - CIRCLE_M / 2.0 * math.hypot(2.0, 0.3)  # of the place beside the robot
    assert heading_of_person_at_origin(robot, walls_m=wall_at_y(lowest_m - 1.1 * BODY_M)) < 0.0
    for wall_m in (lowest_m, lowest_m + 1.1 * BODY_M):
        assert heading_of_person_at_origin(robot, walls_m=wall_at_y(wall_m)) > 0.0


@pytest.mark.parametrize(("clearance_m", "passes"), [(0.2, True), (None, False)])
def test_who_meets_a_robot_in_line_walks_around_it_and_is_not_pushed_back(clearance_m, passes):
    """It comes at 0.3 m/s; on the left a wall leaves no room. Repulsion alone has no side here."""
    walls_m = wall_at_y(0.6) if passes else FAR_WALL
    crowd = crowd_at("collision_prediction", [[0.0, 0.0]], [[50.0, 0.0]], walls_m=walls_m)
    crowd._model = dataclasses.replace(crowd._model, evasion_clearance_m=clearance_m)
    for x_m in 4.0 - 0.3 * 0.05 * np.arange(200):
        place = walk(crowd, 1, robot_at(x_m, 0.0, velocity_x_mps=-0.3))[0]
    assert bool(place[0] > x_m) is passes
    assert not passes or place[1] < 0.1


def test_in_a_ring_corridor_people_see_the_robot_beyond_the_seam():
    crowd = crowd_at("collision_prediction", [[9.5, 0.0]], [[50.0, 0.0]], period_m=10.0)
    crowd.step(0.05, robot_at(1.0, 0.1))
    assert crowd.velocity_y_mps[0] < -0.05
