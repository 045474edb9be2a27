"""A robot that has the commanded velocity, within its limits and outside walls; its contacts.

A contact begins when the bodies touch and ends when they are a little apart again, so that one
bump counts once. It is the robot's when it closes in faster than the person does. Without physics
bodies touch when they overlap.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from serd_core.arrays import BoolArray
from serd_sim.crowd.crowd import Crowd
from serd_sim.crowd.robots import RobotBody
from serd_sim.crowd.social_force import WallGeometry
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.command import Command, chord_velocity, limited_velocity
from serd_sim.world.observation import Pose

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
        gap_m = wall_distance_m - robot.radius_m
        at_wall = gap_m < _TOUCH_M if touches is None else touches.wall
        on_wall = at_wall and not self._touching_wall
        self._touching_wall = at_wall or (self._touching_wall and gap_m < _APART_M)
        away_x, away_y = crowd.x_m - robot.x_m, crowd.y_m - robot.y_m
        distance = np.sqrt(away_x * away_x + away_y * away_y)
        gap = distance - (robot.radius_m + crowd.body_radius_m)
        self.minimum_distance_m = min(self.minimum_distance_m, float(gap.min(initial=np.inf)))
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
        self._touching = touch | (self._touching & (gap < _APART_M))
        self.counts = ContactCounts(
            self.counts.robot_on_person + int((new & by_robot).sum()),
            self.counts.person_on_robot + int((new & ~by_robot).sum()),
            self.counts.robot_on_wall + int(on_wall),
        )


_CORNER_PASSES = 3


@dataclass(frozen=True)
class RobotState:
    """Where the robot is and how it moves; pose: (x_m, y_m, yaw_rad), yaw in [-pi, pi]."""

    pose: Pose
    speed_mps: float = 0.0
    yaw_rate_radps: float = 0.0


class KinematicRobot:
    """Drives commands exactly, outside walls; `state` is the truth."""

    #: It has no wheels.
    wheel_motion: tuple[float, float] | None = None

    def __init__(self, scenario: Scenario) -> None:
        self._settings, self._step_s = scenario.robot, scenario.control_period_s
        self._walls = WallGeometry(scenario.wall_segments_m)
        self.place((0.0, 0.0, 0.0))

    def place(self, pose: Pose, speed_mps: float = 0.0, yaw_rate_radps: float = 0.0) -> None:
        """Set the pose and the velocity of the robot."""
        pose = *pose[:2], math.remainder(pose[2], math.tau)
        self.state = RobotState(pose, speed_mps, yaw_rate_radps)
        self.wall_distance_m = self._walls.nearest_m(*pose[:2])

    def drive(self, command: Command, _crowd: Crowd) -> Touches | None:
        """One control period towards the command; what a wall takes of the speed is lost."""
        before, step_s = self.state, self._step_s
        speeds = before.speed_mps, before.yaw_rate_radps
        speed, yaw_rate = limited_velocity(command, *speeds, self._settings, step_s)
        x_m, y_m, yaw_rad = before.pose
        vx_mps, vy_mps = chord_velocity(yaw_rad, speed, yaw_rate, step_s)
        pose = x_m + step_s * vx_mps, y_m + step_s * vy_mps, yaw_rad + step_s * yaw_rate
        self.place(pose, speed, yaw_rate)
        if self.wall_distance_m < self._settings.radius_m:
            self._leave_walls(before.pose)
        return None

    def close(self) -> None:
        """Do nothing: it has no world of its own."""

    def _leave_walls(self, before: Pose) -> None:
        """Slide along the walls: out of them, with what is left of the speed along the heading.

        `wall_distance_m` stays what it was inside, so that the contact can be seen.
        """
        x_m, y_m, yaw_rad = self.state.pose
        for _ in range(_CORNER_PASSES):
            wall = int(np.argmin(self._walls.distance_m[0]))
            distance = float(self._walls.distance_m[0, wall])
            depth = self._settings.radius_m - distance
            if depth <= 0.0:
                break
            x_m += depth * float(self._walls.dx_m[0, wall]) / max(distance, 1e-9)
            y_m += depth * float(self._walls.dy_m[0, wall]) / max(distance, 1e-9)
            self._walls.nearest_m(x_m, y_m)
        moved = (x_m - before[0]) * math.cos(yaw_rad) + (y_m - before[1]) * math.sin(yaw_rad)
        self.state = replace(self.state, pose=(x_m, y_m, yaw_rad), speed_mps=moved / self._step_s)

    @property
    def body(self) -> RobotBody:
        """The robot as people feel it."""
        (x_m, y_m, yaw_rad), speed = self.state.pose, self.state.speed_mps
        return RobotBody(
            x_m=x_m,
            y_m=y_m,
            velocity_x_mps=speed * math.cos(yaw_rad),
            velocity_y_mps=speed * math.sin(yaw_rad),
            radius_m=self._settings.radius_m,
        )
