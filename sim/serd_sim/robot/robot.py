"""The motion of a robot that has the commanded velocity, within its limits and outside walls."""

import math
from dataclasses import dataclass, replace

import numpy as np

from serd_sim.crowd.crowd import Crowd
from serd_sim.crowd.robots import RobotBody
from serd_sim.crowd.social_force import WallGeometry
from serd_sim.robot.contacts import Touches
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.command import Command, chord_velocity, limited_velocity
from serd_sim.world.observation import Pose

_CORNER_PASSES = 3


@dataclass(frozen=True)
class RobotState:
    """Where the robot is and how it moves; pose: (x_m, y_m, yaw_rad), yaw in [-pi, pi]."""

    pose: Pose
    speed_mps: float = 0.0
    yaw_rate_radps: float = 0.0


def standing_at(pose: Pose) -> RobotState:
    """State of a robot that stands at a pose."""
    return RobotState((*pose[:2], math.remainder(pose[2], math.tau)))


class KinematicRobot:
    """Drives commands exactly, outside walls; `state` is the truth."""

    #: It has no wheels.
    wheel_motion: tuple[float, float] | None = None

    def __init__(self, scenario: Scenario) -> None:
        self._settings, self._step_s = scenario.robot, scenario.control_period_s
        self._walls = WallGeometry(scenario.wall_segments_m)
        self.state = standing_at((0.0, 0.0, 0.0))
        self.wall_distance_m = math.inf

    def place(self, state: RobotState) -> None:
        """Set the pose and the velocity of the robot."""
        self.state = state
        self.wall_distance_m = self._walls.nearest_m(*state.pose[:2])

    def drive(self, command: Command, _crowd: Crowd) -> Touches | None:
        """One control period towards the command; what a wall takes of the speed is lost."""
        before, step_s = self.state, self._step_s
        speeds = before.speed_mps, before.yaw_rate_radps
        speed, yaw_rate = limited_velocity(command, *speeds, self._settings, step_s)
        x_m, y_m, yaw_rad = before.pose
        vx_mps, vy_mps = chord_velocity(yaw_rad, speed, yaw_rate, step_s)
        pose = x_m + step_s * vx_mps, y_m + step_s * vy_mps, yaw_rad + step_s * yaw_rate
        self.place(replace(standing_at(pose), speed_mps=speed, yaw_rate_radps=yaw_rate))
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
