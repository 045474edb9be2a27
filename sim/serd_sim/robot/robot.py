"""The motion of a robot that has the commanded velocity, within its limits and outside walls."""

import math
from dataclasses import dataclass, replace

import numpy as np

from serd_sim.crowd.crowd import Crowd
from serd_sim.crowd.robots import RobotBody
from serd_sim.crowd.social_force import WallGeometry
from serd_sim.robot.bullet import close, new_world, pybullet
from serd_sim.robot.contacts import Touches
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.command import Command, chord_velocity, limited_velocity
from serd_sim.world.observation import Pose

_CORNER_PASSES = 3


@dataclass(frozen=True)
class RobotState:
    """Where the robot is and how it moves.

    half_turn: (z, w) of the orientation quaternion, which is what the physics world integrates.
    """

    x_m: float
    y_m: float
    half_turn: tuple[float, float]
    speed_mps: float = 0.0
    yaw_rate_radps: float = 0.0

    @property
    def pose(self) -> Pose:
        """(x_m, y_m, yaw_rad), yaw in [-pi, pi]."""
        z, w = self.half_turn
        return self.x_m, self.y_m, 2.0 * (math.atan2(z, w) if w >= 0 else math.atan2(-z, -w))


def standing_at(pose: Pose) -> RobotState:
    """State of a robot that stands at a pose."""
    half = 0.5 * pose[2]
    return RobotState(pose[0], pose[1], (math.sin(half), math.cos(half)))


class KinematicRobot:
    """Drives commands exactly; `state` is the truth.

    A cylinder in a PyBullet world of its own has the velocity it is set to. Nothing touches it: the
    robot keeps it out of the walls.
    """

    #: It has no wheels.
    wheel_motion: tuple[float, float] | None = None

    def __init__(self, scenario: Scenario) -> None:
        self._settings = robot = scenario.robot
        self._step_s = scenario.control_period_s
        self._client = client = new_world()
        # Called in every period: a client looks a function up anew each time.
        self._set_pose = client.resetBasePositionAndOrientation
        self._pose_of = client.getBasePositionAndOrientation
        self._set_velocity, self._step = client.resetBaseVelocity, client.stepSimulation
        client.setGravity(0, 0, 0)
        client.setPhysicsEngineParameter(fixedTimeStep=self._step_s, numSubSteps=0)
        cylinder = pybullet.GEOM_CYLINDER
        shape = client.createCollisionShape(cylinder, radius=robot.radius_m, height=robot.height_m)
        self._body: int = client.createMultiBody(20.0, shape, -1, (0, 0, 0.5 * robot.height_m))
        client.changeDynamics(
            self._body,
            -1,
            lateralFriction=0.0,
            linearDamping=0.0,
            angularDamping=0.0,
            restitution=0.0,
            localInertiaDiagonal=(0.0, 0.0, 1.0),
            activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING,
        )
        self._walls = WallGeometry(scenario.wall_segments_m)
        self.state = standing_at((0.0, 0.0, 0.0))
        self.wall_distance_m = math.inf

    def place(self, state: RobotState) -> None:
        """Set the pose and the velocity of the robot."""
        self._put(state)
        self.state = state
        self.wall_distance_m = self._walls.nearest_m(self.state.x_m, self.state.y_m)

    def drive(self, command: Command, _crowd: Crowd) -> Touches | None:
        """One control period towards the command; what a wall takes of the speed is lost."""
        before = self.state
        speed, yaw_rate = limited_velocity(
            command, before.speed_mps, before.yaw_rate_radps, self._settings, self._step_s
        )
        chord = chord_velocity(before.pose[2], speed, yaw_rate, self._step_s)
        # From the state, not from where Bullet has the robot: its matrix differs from what the
        # quaternion gives in the last bit.
        self._put(before)
        self._set_velocity(self._body, (*chord, 0.0), (0.0, 0.0, yaw_rate))
        self._step()
        (x_m, y_m, _), (_, _, z, w) = self._pose_of(self._body)
        self.state = RobotState(x_m, y_m, (z, w), speed, yaw_rate)
        self.wall_distance_m = self._walls.nearest_m(self.state.x_m, self.state.y_m)
        if self.wall_distance_m < self._settings.radius_m:
            self._leave_walls(before.pose)
        return None

    def close(self) -> None:
        """Give PyBullet's world back; a second call does nothing."""
        close(self._client)

    def _put(self, state: RobotState) -> None:
        place_m = (state.x_m, state.y_m, 0.5 * self._settings.height_m)
        turn = (0.0, 0.0, *state.half_turn)
        self._set_pose(self._body, place_m, turn)

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
        self.state = replace(self.state, x_m=x_m, y_m=y_m, speed_mps=moved / self._step_s)
        self._put(self.state)

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
