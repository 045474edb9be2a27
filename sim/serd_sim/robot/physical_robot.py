"""A robot on wheels: commands become wheel speeds, and the physics decides how it moves.

The controller is that of a differential drive, (v, w) -> (v -+ w L / 2) / r, with limits of
acceleration on the commanded velocity; odometry is its inverse on the wheels' angles. Both assume
the radius r and the separation L, which may differ from those of the body.
"""

import math
from dataclasses import replace

import numpy as np

from serd_sim.crowd.crowd import Crowd
from serd_sim.crowd.distances import WallGeometry
from serd_sim.crowd.robots import RobotBody
from serd_sim.robot.contacts import Touch, Touches
from serd_sim.robot.dynamics import Dynamics, Impulses, PhysicalState
from serd_sim.robot.people_bodies import near_people
from serd_sim.robot.robot import RobotState
from serd_sim.robot.unicycle import limited_velocity
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.command import Command

_NEAR_WALLS_M = 0.2


class PhysicalRobot:
    """Drives commands among rigid bodies; `state` is the truth."""

    def __init__(self, scenario: Scenario, person_radius_m: float) -> None:
        settings = scenario.robot
        drive = settings.differential_drive()
        self._wheel_radius_m = settings.wheel_radius_m or settings.rolling_radius_m(drive)
        self._separation_m = settings.wheel_separation_m or drive.separation_m
        self._settings, self._step_s = settings, scenario.control_period_s
        self._person_radius_m = person_radius_m
        self._dynamics = Dynamics(scenario, person_radius_m)
        self._walls = WallGeometry(1, scenario.wall_segments_m)
        self.state = PhysicalState(0.0, 0.0, (0.0, 1.0))
        self.wheel_motion: tuple[float, float] | None = None
        self.wall_distance_m = math.inf

    def place(self, state: RobotState) -> None:
        """Return to the state of a snapshot, or put the robot on the floor of a new world."""
        if isinstance(state, PhysicalState) and state.history is not None:
            self._dynamics.load(state.history)
            self.state = replace(state, history=None)
        else:
            self._dynamics.place(state)
            self.state = self._dynamics.state((state.speed_mps, state.yaw_rate_radps))
        self._measure_walls()

    def snapshot(self) -> PhysicalState:
        """The state with that of all bodies."""
        return replace(self.state, history=self._dynamics.save())

    def drive(self, command: Command, crowd: Crowd) -> Touches:
        """One control period towards the command; people whom the robot touches are pushed.

        crowd: has made its step, and gets the motion of those people.
        """
        before = self.state
        target = limited_velocity(command, *before.target, self._settings, self._step_s)
        velocities = crowd.velocity_mps
        places = crowd.position_m - self._step_s * velocities
        reach_m = self._settings.radius_m + self._person_radius_m
        away_m = np.hypot(places[:, 0] - before.x_m, places[:, 1] - before.y_m)
        near = near_people(away_m, reach_m, self._step_s, places, velocities)
        near_walls = self.wall_distance_m < self._settings.radius_m + _NEAR_WALLS_M
        impulses = self._dynamics.drive(self._wheel_speeds(target), near, near_walls=near_walls)
        touches = self._touches(impulses, crowd)
        for person in impulses.people_ns:
            crowd.move(person, *self._dynamics.people.motion(person))
        self.state = self._dynamics.state(target)
        self.wheel_motion = self._wheel_motion(before.wheels_rad)
        self._measure_walls()
        return touches

    @property
    def body(self) -> RobotBody:
        """The robot as people feel it."""
        return RobotBody(
            self.state.x_m, self.state.y_m, *self.state.velocity_mps, self._settings.radius_m
        )

    def close(self) -> None:
        """Give PyBullet's world back; a second call does nothing."""
        self._dynamics.close()

    def _wheel_speeds(self, target: tuple[float, float]) -> tuple[float, float]:
        speed, half = target[0], 0.5 * target[1] * self._separation_m
        return (speed - half) / self._wheel_radius_m, (speed + half) / self._wheel_radius_m

    def _wheel_motion(self, before_rad: tuple[float, float]) -> tuple[float, float]:
        """(distance_m, turned_rad) of the last control period by the wheels' angles."""
        left, right = (
            self._wheel_radius_m * (now - before)
            for now, before in zip(self.state.wheels_rad, before_rad, strict=True)
        )
        return 0.5 * (left + right), (right - left) / self._separation_m

    def _touches(self, impulses: Impulses, crowd: Crowd) -> Touches:
        """Who touched, with the velocities before the control period; by its pose."""
        x_m, y_m, _ = self.state.pose
        vx, vy = self.state.velocity_mps
        people = {}
        for person, impulse_ns in impulses.people_ns.items():
            away = np.array([crowd.x_m[person] - x_m, crowd.y_m[person] - y_m])
            away /= max(float(np.hypot(*away)), 1e-9)
            robots = float(away @ (vx, vy))
            persons = -float(away @ (crowd.velocity_x_mps[person], crowd.velocity_y_mps[person]))
            people[person] = Touch(impulse_ns, robots + persons, robots > max(persons, 0.0))
        wall = None
        if impulses.walls_ns > 0.0:
            nearest = int(np.argmin(self._walls.distance_m[0]))
            distance = max(float(self._walls.distance_m[0, nearest]), 1e-9)
            dx, dy = float(self._walls.dx_m[0, nearest]), float(self._walls.dy_m[0, nearest])
            closing_mps = -(vx * dx + vy * dy) / distance
            wall = Touch(impulses.walls_ns, closing_mps, True)
        return Touches(people, wall)

    def _measure_walls(self) -> None:
        here = np.array(self.state.pose[:2])
        self._walls.update(here[:1], here[1:])
        self.wall_distance_m = float(self._walls.distance_m.min())
