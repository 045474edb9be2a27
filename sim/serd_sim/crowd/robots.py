"""The robot as people see it, and how they walk around it where it is in their way."""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import BoolArray, FloatArray
from serd_sim.crowd.social_force import Force, WallGeometry

#: How far before the circle that they walk around people turn aside.
_NOTICED_M = 2.0


@dataclass(frozen=True)
class RobotBody:
    """A disc that moves."""

    x_m: float
    y_m: float
    velocity_x_mps: float
    velocity_y_mps: float
    radius_m: float


def headings_around(
    robot: RobotBody,
    to_robot_m: tuple[FloatArray, FloatArray, FloatArray],
    wanted: Force,
    speed_mps: FloatArray,
    walls: WallGeometry,
    body_radius_m: float,
    clearance_m: float,
) -> Force:
    """(N,) x and y of the wanted headings, of some people along tangents round a robot.

    to_robot_m: x, y and length of the vectors from people to the robot. clearance_m: between the
    surfaces of robot and person on a circle. Those whose straight way leads through it, and whom
    the robot does not outrun, take the tangent on the nearer side, or on the other one where only
    that has room between robot and walls. Within the circle they walk across its radius.
    """
    (to_x, to_y, distance), (wanted_x, wanted_y) = to_robot_m, wanted
    circle_m = clearance_m + body_radius_m + robot.radius_m
    ahead = wanted_x * to_x + wanted_y * to_y
    aside = wanted_x * to_y - wanted_y * to_x
    outrun = robot.velocity_x_mps * to_x + robot.velocity_y_mps * to_y
    in_the_way = (ahead > 0.0) & (np.abs(aside) < circle_m)
    in_the_way &= (distance < circle_m + _NOTICED_M) & (speed_mps * ahead > outrun)
    rows = in_the_way.nonzero()[0]
    if not len(rows):
        return wanted_x, wanted_y
    away = distance[rows]
    to_x, to_y = to_x[rows] / away, to_y[rows] / away
    left_x, left_y = circle_m * -to_y, circle_m * to_x
    on_left, on_right = (
        _have_room(side * left_x, side * left_y, robot, walls, body_radius_m)
        for side in (1.0, -1.0)
    )
    passes_left = np.where(on_left == on_right, aside[rows] <= 0.0, on_left)
    sine = np.minimum(circle_m / away, 1.0)
    cosine = np.sqrt(1.0 - sine * sine)
    sine = np.where(passes_left, sine, -sine)
    past_x, past_y = wanted_x.copy(), wanted_y.copy()
    past_x[rows] = cosine * to_x - sine * to_y
    past_y[rows] = cosine * to_y + sine * to_x
    return past_x, past_y


def _have_room(
    x_m: FloatArray, y_m: FloatArray, robot: RobotBody, walls: WallGeometry, radius_m: float
) -> BoolArray:
    """(N,) whether no wall is within a body's radius of a place relative to the robot, nor between
    the two."""
    start_m = walls.start_m - np.array([[robot.x_m], [robot.y_m]])
    unit, length_m = walls.unit, walls.length_m
    dx, dy = x_m[:, None] - start_m[0], y_m[:, None] - start_m[1]
    position = np.minimum(np.maximum(dx * unit[0] + dy * unit[1], 0.0), length_m)
    away_x, away_y = dx - position * unit[0], dy - position * unit[1]
    near = np.sqrt(away_x * away_x + away_y * away_y) < radius_m
    # The wall's line parts the place from the robot, and their line the ends of the wall.
    side = unit[0] * dy - unit[1] * dx
    side_of_robot = unit[0] * -start_m[1] - unit[1] * -start_m[0]
    end_x, end_y = start_m + length_m * unit
    side_of_start = x_m[:, None] * start_m[1] - y_m[:, None] * start_m[0]
    side_of_end = x_m[:, None] * end_y - y_m[:, None] * end_x
    between = (side * side_of_robot <= 0.0) & (side_of_start * side_of_end <= 0.0)
    start = x_m[:, None] * start_m[0] + y_m[:, None] * start_m[1]
    end = x_m[:, None] * end_x + y_m[:, None] * end_y
    squared = (x_m * x_m + y_m * y_m)[:, None]
    overlap = (np.maximum(start, end) >= 0.0) & (np.minimum(start, end) <= squared)
    in_line = (side == 0.0) & (side_of_robot == 0.0)
    room: BoolArray = ~(near | np.where(in_line, overlap, between)).any(axis=1)
    return room
