"""Robots as people see them, and how people walk around one that is in their way."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely

from serd_core.arrays import BoolArray, FloatArray
from sim.crowd.social_force import Force

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


@dataclass(frozen=True, eq=False)
class Evasion:
    """Headings along the tangents of circles around robots.

    clearance_m: between the surfaces of robot and person on these circles. walls_m: (W, 2, 2).
    """

    clearance_m: float
    body_radius_m: float
    walls_m: FloatArray

    def headings(
        self,
        robot: RobotBody,
        to_robot_m: tuple[FloatArray, FloatArray, FloatArray],
        wanted: Force,
        speed_mps: FloatArray,
    ) -> Force:
        """(N,) x and y of the wanted headings, of some people past the robot.

        to_robot_m: x, y and length of the vectors from people to the robot. Those whose straight
        way leads through the circle, and whom the robot does not outrun, take the tangent on the
        nearer side, or on the other one where only that has room between robot and walls. Within
        the circle they walk across its radius. Several robots are passed one after the other.
        """
        (to_x, to_y, distance), (wanted_x, wanted_y) = to_robot_m, wanted
        circle_m = self.clearance_m + self.body_radius_m + robot.radius_m
        ahead = wanted_x * to_x + wanted_y * to_y
        aside = wanted_x * to_y - wanted_y * to_x
        outrun = robot.velocity_x_mps * to_x + robot.velocity_y_mps * to_y
        in_the_way = (ahead > 0.0) & (np.abs(aside) < circle_m)
        in_the_way &= (distance < circle_m + _NOTICED_M) & (speed_mps * ahead > outrun)
        rows = in_the_way.nonzero()[0]
        if not len(rows):
            return wanted
        away = distance[rows]
        to_x, to_y = to_x[rows] / away, to_y[rows] / away
        left = np.stack([-to_y, to_x], axis=1)
        sides_m = circle_m * np.concatenate([left, -left])
        on_left, on_right = np.split(self._has_room(robot, sides_m), 2)
        passes_left = np.where(on_left == on_right, aside[rows] <= 0.0, on_left)
        sine = np.minimum(circle_m / away, 1.0)
        cosine = np.sqrt(1.0 - sine * sine)
        sine = np.where(passes_left, sine, -sine)
        past_x, past_y = wanted_x.copy(), wanted_y.copy()
        past_x[rows] = cosine * to_x - sine * to_y
        past_y[rows] = cosine * to_y + sine * to_x
        return past_x, past_y

    def _has_room(self, robot: RobotBody, away_m: FloatArray) -> BoolArray:
        """Whether walls leave room for a person at (N, 2) places relative to the robot."""
        centre_m = np.array([robot.x_m, robot.y_m])
        places_m = centre_m + away_m
        ways = shapely.linestrings(np.stack([np.broadcast_to(centre_m, away_m.shape), places_m], 1))
        near = shapely.distance(shapely.points(places_m), self._walls) < self.body_radius_m
        has_room: BoolArray = ~(near | shapely.intersects(ways, self._walls))
        return has_room

    @cached_property
    def _walls(self) -> shapely.MultiLineString:
        walls = shapely.multilinestrings(shapely.linestrings(self.walls_m))
        shapely.prepare(walls)
        return walls
