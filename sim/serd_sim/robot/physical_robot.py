"""A robot on driven wheels under gravity, among walls and people whom it can touch.

The controller is that of a differential drive, (v, w) -> (v -+ w L / 2) / r, with limits of
acceleration on the commanded velocity; odometry is its inverse on the wheels' angles. Both assume
the radius r, which may differ from that of the body.

A world is built anew for each start, because contacts carry hidden state from substep to substep,
which only a new world is free of.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from serd_sim.crowd.crowd import Crowd
from serd_sim.crowd.robots import RobotBody
from serd_sim.crowd.social_force import WallGeometry
from serd_sim.errors import SimError
from serd_sim.robot.bullet import (
    BulletClient,
    Moving,
    PeopleBodies,
    Velocity,
    add_wall,
    let_move_freely,
    load_urdf,
    near_people,
    new_world,
    pybullet,
    turned,
)
from serd_sim.robot.robot import RobotState, Touches
from serd_sim.robot.urdf import conjugate, product, rotated, yaw_of
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.command import Command, limited_velocity
from serd_sim.world.observation import Pose

Wheels = tuple[float, float]

_GRAVITY_MPS2 = 9.81
_LONGEST_SUBSTEP_S = 0.005
_SOLVER_ITERATIONS = 20
#: Share of a penetration that a substep corrects. The correction is a velocity: the default of 0.2
#: makes bodies bounce off that walk into each other.
_CONTACT_ERP = 0.02
_FLOOR_FRICTION, _WHEEL_FRICTION = 1.0, 0.8
_SETTLING_S = 0.3
_FOOTPRINT_TOLERANCE_M = 0.02
_NEAR_WALLS_M = 0.2
#: Of a link without <inertial>, for which PyBullet would assume 1 kg.
_FRAME_MASS_KG, _FRAME_INERTIA_KGM2 = 1e-3, (1e-6, 1e-6, 1e-6)


@dataclass(frozen=True)
class PhysicalState(RobotState):
    """Where the root link of a robot on wheels is.

    velocity_mps: of the root link's centre of mass. target: commanded (v, w) after the limits.
    """

    velocity_mps: Velocity = (0.0, 0.0)
    wheels_rad: Wheels = (0.0, 0.0)
    target: tuple[float, float] = (0.0, 0.0)


class PhysicalRobot:
    """Drives commands among rigid bodies; `state` is the truth. Call `place` before `drive`.

    wheel_motion: (distance_m, turned_rad) of the last control period by the wheels' angles.
    """

    def __init__(self, scenario: Scenario, person_radius_m: float) -> None:
        self._settings = settings = scenario.robot
        self._person_radius_m, self._step_s = person_radius_m, scenario.control_period_s
        self._drive = settings.differential_drive()
        rolling_radius_m = self._drive.radius_m or settings.wheel_radius_m
        assert rolling_radius_m is not None  # by the validator of the settings
        self._rolling_radius_m = rolling_radius_m
        self._wheel_radius_m = settings.wheel_radius_m or rolling_radius_m
        self._separation_m = self._drive.separation_m
        self._torques_nm = (settings.wheel_torque_nm, settings.wheel_torque_nm)
        self._n_substeps = math.ceil(self._step_s / _LONGEST_SUBSTEP_S - 1e-9)
        self._substep_s = self._step_s / self._n_substeps
        self._wheels_radps: Wheels = (0.0, 0.0)
        self._wall_segments_m = scenario.wall_segments_m
        self._wall_geometry = WallGeometry(scenario.wall_segments_m)
        self.state = PhysicalState((0.0, 0.0, 0.0))
        self.wheel_motion: tuple[float, float] | None = None
        self.wall_distance_m = math.inf
        self._client: BulletClient = None
        self._build()  # so that a robot that does not fit is rejected now

    def place(self, pose: Pose) -> None:
        """Put the robot on the floor of a new world, where it stands."""
        self._build()
        turn = turned(math.remainder(pose[2], math.tau))
        root_m = (*pose[:2], self._rolling_radius_m - self._drive.axle_height_m)
        place = np.add(root_m, rotated(turn, self._mass_in_root[0]))
        turn = product(turn, self._mass_in_root[1])
        self._client.resetBasePositionAndOrientation(self._robot, place, turn)
        self._turn_wheels((0.0, 0.0))
        for _ in range(math.ceil(_SETTLING_S / self._substep_s)):
            self._client.stepSimulation()
        self._client.resetBaseVelocity(self._robot, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        self._wheels_radps = (0.0, 0.0)
        for joint in self._wheels:
            self._client.resetJointState(self._robot, joint, 0.0, 0.0)
        self._observe((0.0, 0.0))

    def drive(self, command: Command, crowd: Crowd) -> Touches:
        """One control period towards the command; people whom the robot touches are pushed.

        crowd: has made its step, and gets the motion of those people.
        """
        before = self.state
        target = limited_velocity(command, *before.target, self._settings, self._step_s)
        velocities = crowd.velocity_mps
        places = crowd.position_m - self._step_s * velocities
        reach_m = self._settings.radius_m + self._person_radius_m
        away_m = np.hypot(*(places - before.pose[:2]).T)
        near = near_people(away_m, reach_m, self._step_s, places, velocities)
        speed_mps, half_mps = target[0], 0.5 * target[1] * self._separation_m
        wheels_mps = speed_mps - half_mps, speed_mps + half_mps
        left_radps, right_radps = (each / self._wheel_radius_m for each in wheels_mps)
        people, wall = self.roll((left_radps, right_radps), near)
        touches = Touches({person: self._is_by_robot(person, crowd) for person in people}, wall)
        for person in people:
            crowd.move(person, *self.people.motion(person))
        self._observe(target)
        left, right = (
            self._wheel_radius_m * (now - then)
            for now, then in zip(self.state.wheels_rad, before.wheels_rad, strict=True)
        )
        self.wheel_motion = 0.5 * (left + right), (right - left) / self._separation_m
        return touches

    def roll(self, wheels_radps: Wheels, people: Mapping[int, Moving]) -> tuple[set[int], bool]:
        """Advance by one control period; the wheels' targets change linearly to those given.

        people: those near the robot, with their motion at its beginning. Returns who touched the
        robot, and whether a wall did.
        """
        near_walls = self.wall_distance_m < self._settings.radius_m + _NEAR_WALLS_M
        (left, right), self._wheels_radps = self._wheels_radps, wheels_radps
        more_left, more_right = wheels_radps[0] - left, wheels_radps[1] - right
        self.people.place(people)
        touching = set[int]()
        for substep in range(1, self._n_substeps + 1):
            share = substep / self._n_substeps
            self._turn_wheels((left + share * more_left, right + share * more_right))
            self._step()
            if near_walls or people:
                points = self._client.getContactPoints(self._robot)
                touching |= {point[2] for point in points if point[9] > 0.0}
        touching.discard(self._floor)
        bodies = touching - self._walls
        return {self.people.person_in(body) for body in bodies}, bodies != touching

    @property
    def body(self) -> RobotBody:
        """The robot as people feel it."""
        state = self.state
        return RobotBody(*state.pose[:2], *state.velocity_mps, self._settings.radius_m)

    def close(self) -> None:
        """Leave PyBullet; a second call does nothing."""
        if self._client is not None and self._client.isConnected():
            self._client.disconnect()

    def _is_by_robot(self, person: int, crowd: Crowd) -> bool:
        """Whether the robot closed in faster, by the velocities before the control period."""
        away = np.array([crowd.x_m[person], crowd.y_m[person]]) - self.state.pose[:2]
        away /= max(float(np.hypot(*away)), 1e-9)
        persons = -float(away @ (crowd.velocity_x_mps[person], crowd.velocity_y_mps[person]))
        return float(away @ self.state.velocity_mps) > max(persons, 0.0)

    def _observe(self, target: tuple[float, float]) -> None:
        """Read where the robot is, how it moves, and how far the walls are; target: of the state.

        PyBullet places a body by the frame of its mass.
        """
        place, turn = self._client.getBasePositionAndOrientation(self._robot)
        turn = product(turn, conjugate(self._mass_in_root[1]))
        mass_x_m, mass_y_m, _ = rotated(turn, self._mass_in_root[0])
        (vx_mps, vy_mps, _), rates = self._client.getBaseVelocity(self._robot)
        yaw_rad = yaw_of(turn)
        wheels = self._client.getJointStates(self._robot, self._wheels)
        left, right = (
            sign * state[0] for sign, state in zip(self._drive.turns_forward, wheels, strict=True)
        )
        self.state = PhysicalState(
            (place[0] - mass_x_m, place[1] - mass_y_m, math.remainder(yaw_rad, math.tau)),
            vx_mps * math.cos(yaw_rad) + vy_mps * math.sin(yaw_rad),
            rates[2],
            (vx_mps, vy_mps),
            (left, right),
            target,
        )
        self.wall_distance_m = self._wall_geometry.nearest_m(*self.state.pose[:2])

    def _build(self) -> None:
        self.close()
        self._client = new_world()
        try:
            self._add_bodies(self._client)
        except BaseException:
            self.close()
            raise

    def _add_bodies(self, client: BulletClient) -> None:
        # Called in every substep: a client looks a function up anew each time.
        self._step, self._set_motors = client.stepSimulation, client.setJointMotorControlArray
        client.setGravity(0, 0, -_GRAVITY_MPS2)
        client.setPhysicsEngineParameter(
            fixedTimeStep=self._substep_s,
            numSubSteps=0,
            numSolverIterations=_SOLVER_ITERATIONS,
            contactERP=_CONTACT_ERP,
            # With a cone, sideways forces between the wheels use up the friction of forward ones.
            enableConeFriction=0,
            deterministicOverlappingPairs=1,
        )
        plane = client.createCollisionShape(pybullet.GEOM_PLANE)
        self._floor: int = client.createMultiBody(0.0, plane)
        client.changeDynamics(self._floor, -1, lateralFriction=_FLOOR_FRICTION)
        self._walls = {add_wall(client, *segment) for segment in self._wall_segments_m}
        self._robot = self._load_robot(client)
        self._require_footprint()
        apart_from = (self._floor, *self._walls)
        self.people = PeopleBodies(client, self._person_radius_m, apart_from=apart_from)

    def _load_robot(self, client: BulletClient) -> int:
        drive = self._drive
        body = load_urdf(client, drive.path, flags=pybullet.URDF_USE_INERTIA_FROM_FILE)
        links, joints = {client.getBodyInfo(body)[0].decode(): -1}, {}
        for number in range(client.getNumJoints(body)):
            information = client.getJointInfo(body, number)
            joints[information[1].decode()] = number
            links[information[12].decode()] = number
        self._wheels = tuple(joints[name] for name in drive.wheel_joints)
        for name, link in links.items():
            friction = _WHEEL_FRICTION if link in self._wheels else 0.0
            frame = {"mass": _FRAME_MASS_KG, "localInertiaDiagonal": _FRAME_INERTIA_KGM2}
            client.changeDynamics(
                body,
                link,
                lateralFriction=friction,
                restitution=0.0,
                **(frame if name in drive.massless else {}),
            )
        let_move_freely(client, body)
        self._mass_in_root = client.getDynamicsInfo(body, -1)[3:5]
        return body

    def _require_footprint(self) -> None:
        """The bodies of the robot lie within the scenario's radius."""
        links = range(-1, self._client.getNumJoints(self._robot))
        boxes = [self._client.getAABB(self._robot, link) for link in links]
        widest_m = max(abs(each) for low, high in boxes for each in (*low[:2], *high[:2]))
        radius_m = self._settings.radius_m
        if widest_m > radius_m + _FOOTPRINT_TOLERANCE_M:
            raise SimError(
                f"robot.radius_m must cover the robot of {self._drive.path}, which extends "
                f"{widest_m:.3f} m from its root link, got {radius_m:g} m; raise it"
            )

    def _turn_wheels(self, wheels_radps: Wheels) -> None:
        left, right = self._drive.turns_forward
        self._set_motors(
            self._robot,
            self._wheels,
            pybullet.VELOCITY_CONTROL,
            targetVelocities=(left * wheels_radps[0], right * wheels_radps[1]),
            forces=self._torques_nm,
        )
