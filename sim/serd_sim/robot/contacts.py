"""Contacts of the robot with people and walls, classified by who ran into whom.

A contact begins when the bodies touch and ends when they are a little apart again, so that one
bump counts once. It is the robot's when it closes in faster than the person does. Without physics
bodies touch when they overlap.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from serd_core.arrays import BoolArray
from serd_sim.crowd.crowd import Crowd
from serd_sim.crowd.robots import RobotBody

_TOUCH_M = 0.0
_APART_M = 0.05


@dataclass(frozen=True)
class ContactCounts:
    """Contacts begun so far in an episode."""

    robot_on_person: int = 0
    person_on_robot: int = 0
    robot_on_wall: int = 0


@dataclass(frozen=True)
class Touches:
    """What touched the robot during a control period.

    people: whether the robot closed in faster, by the index of each person who did.
    """

    people: Mapping[int, bool]
    wall: bool


class ContactCounter:
    """Counts contacts over an episode of `n_people` people."""

    def __init__(self, n_people: int) -> None:
        self.counts = ContactCounts()
        self.minimum_distance_m = np.inf
        self._touching: BoolArray = np.zeros(n_people, dtype=np.bool_)
        self._touching_wall = False

    def update(
        self, crowd: Crowd, robot: RobotBody, wall_distance_m: float, touches: Touches | None = None
    ) -> None:
        """Count what touches now; distances are between surfaces. touches: those of the physics."""
        on_person = on_robot = 0
        if len(crowd):
            on_person, on_robot = self._update_people(crowd, robot, touches)
        gap = wall_distance_m - robot.radius_m
        touch = gap < _TOUCH_M if touches is None else touches.wall
        on_wall = int(touch and not self._touching_wall)
        self._touching_wall = touch or (self._touching_wall and gap < _APART_M)
        if on_person or on_robot or on_wall:
            self.counts = ContactCounts(
                robot_on_person=self.counts.robot_on_person + on_person,
                person_on_robot=self.counts.person_on_robot + on_robot,
                robot_on_wall=self.counts.robot_on_wall + on_wall,
            )

    def _update_people(
        self, crowd: Crowd, robot: RobotBody, touches: Touches | None
    ) -> tuple[int, int]:
        away_x, away_y = crowd.x_m - robot.x_m, crowd.y_m - robot.y_m
        distance = np.sqrt(away_x * away_x + away_y * away_y)
        gap = distance - (robot.radius_m + crowd.body_radius_m)
        nearest = float(gap.min())
        self.minimum_distance_m = min(self.minimum_distance_m, nearest)
        if nearest >= _APART_M and not (touches and touches.people):
            self._touching[:] = False
            return 0, 0
        if touches is None:
            touch = gap < _TOUCH_M
            robots = away_x * robot.velocity_x_mps + away_y * robot.velocity_y_mps
            persons = -(away_x * crowd.velocity_x_mps + away_y * crowd.velocity_y_mps)
            by_robot = robots > np.maximum(persons, 0.0)
        else:
            touch, by_robot = np.zeros((2, len(crowd)), dtype=np.bool_)
            touch[list(touches.people)] = True
            by_robot[list(touches.people)] = list(touches.people.values())
        new = touch & ~self._touching
        by_robot &= new
        self._touching = touch | (self._touching & (gap < _APART_M))
        return int(by_robot.sum()), int((new & ~by_robot).sum())
