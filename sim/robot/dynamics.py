"""Rigid bodies under gravity: a robot on driven wheels, walls, and people whom it can touch.

A world is built anew for each start, because contacts carry hidden state from substep to substep,
which only a new world is free of.
"""

import math
from array import array
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from sim.errors import SimError
from sim.robot.bullet import add_wall, let_move_freely, load_urdf, pybullet
from sim.robot.people_bodies import MOST_NEAR, Moving, PeopleBodies, Velocity
from sim.scenario.scenario import Scenario

Pose = tuple[float, float, float]
Wheels = tuple[float, float]
Quaternion = tuple[float, float, float, float]

_GRAVITY_MPS2 = 9.81
_LONGEST_SUBSTEP_S = 0.005
_SOLVER_ITERATIONS = 20
#: Share of a penetration that a substep corrects. The correction is a velocity: the default of 0.2
#: makes bodies bounce off that walk into each other.
_CONTACT_ERP = 0.02
_FLOOR_FRICTION, _WHEEL_FRICTION = 1.0, 0.8
_SETTLING_S = 0.3
_FOOTPRINT_TOLERANCE_M = 0.02
#: Of a link without <inertial>, for which PyBullet would assume 1 kg.
_FRAME_MASS_KG, _FRAME_INERTIA_KGM2 = 1e-3, (1e-6, 1e-6, 1e-6)


@dataclass(frozen=True)
class BodyMotion:
    """Pose (x_m, y_m, yaw_rad) and velocity of the robot's root link, and its wheels' angles."""

    pose: Pose
    velocity_mps: Velocity
    yaw_rate_radps: float
    wheels_rad: Wheels


@dataclass(frozen=True)
class Start:
    """Pose and speeds of a robot that is put on the floor."""

    pose: Pose
    speed_mps: float = 0.0
    yaw_rate_radps: float = 0.0


@dataclass(frozen=True)
class History:
    """What has acted since the start: wheel targets of each control period, people of some."""

    start: Start
    wheels_radps: tuple[float, ...]
    people: Mapping[int, Mapping[int, Moving]]


@dataclass
class Impulses:
    """Sums over a control period of the normal impulses (N s) on the robot, by who exerts them."""

    walls: float = 0.0
    people: dict[int, float] = field(default_factory=dict)


class Dynamics:
    """The bodies of one scenario. Call `place` or `load` before anything else."""

    def __init__(self, scenario: Scenario, person_radius_m: float) -> None:
        settings = scenario.robot
        self._scenario, self._person_radius_m = scenario, person_radius_m
        self._drive = settings.differential_drive()
        self._wheel_radius_m = settings.rolling_radius_m(self._drive)
        self._torque_nm = settings.wheel_torque_nm
        self._n_substeps = math.ceil(scenario.control_period_s / _LONGEST_SUBSTEP_S - 1e-9)
        self._substep_s = scenario.control_period_s / self._n_substeps
        self._start = Start((0.0, 0.0, 0.0))
        self._target: Wheels = (0.0, 0.0)
        self._wheel_log = array("d")
        self._people_log: dict[int, Mapping[int, Moving]] = {}
        self._client = -1
        self._build()  # so that a robot that does not fit is rejected now

    def place(self, start: Start) -> None:
        """Put the robot on the floor of a new world and give it a velocity."""
        self._start, self._wheel_log, self._people_log = start, array("d"), {}
        self._build()
        self._set_base(start.pose)
        self._turn_wheels((0.0, 0.0))
        for _ in range(math.ceil(_SETTLING_S / self._substep_s)):
            pybullet.stepSimulation(self._client)
        self._target = self._rolling(start)
        self._set_velocity(start)

    def drive(
        self, wheels_radps: Wheels, people: Mapping[int, Moving], *, near_walls: bool = False
    ) -> Impulses:
        """Advance by one control period; the wheels' targets change linearly to those given.

        people: those near the robot, with their motion at its beginning. near_walls: whether
        contacts with walls are looked for.
        """
        if people:
            self._people_log[len(self._wheel_log) // 2] = people
        self._wheel_log.extend(wheels_radps)
        before, self._target = self._target, wheels_radps
        self.people.place(people)
        impulses = Impulses()
        for substep in range(1, self._n_substeps + 1):
            share = substep / self._n_substeps
            left, right = (
                old + share * (new - old) for old, new in zip(before, wheels_radps, strict=True)
            )
            self._turn_wheels((left, right))
            pybullet.stepSimulation(self._client)
            if near_walls or people:
                self._add_contacts(impulses)
        return impulses

    @property
    def motion(self) -> BodyMotion:
        """Where the robot is and how it moves."""
        place, turn = pybullet.getBasePositionAndOrientation(self._robot, self._client)
        turn = _product(turn, self._root_turn)
        x_m, y_m, _ = np.subtract(place, _rotated(turn, self._mass_in_root[0])).tolist()
        (vx_mps, vy_mps, _), (_, _, yaw_rate) = pybullet.getBaseVelocity(self._robot, self._client)
        wheels = pybullet.getJointStates(self._robot, self._wheels, self._client)
        left, right = (
            sign * state[0] for sign, state in zip(self._drive.turns_forward, wheels, strict=True)
        )
        return BodyMotion((x_m, y_m, _yaw_of(turn)), (vx_mps, vy_mps), yaw_rate, (left, right))

    def save(self) -> History:
        """All that has acted since the robot was placed."""
        return History(self._start, tuple(self._wheel_log), dict(self._people_log))

    def load(self, history: History) -> None:
        """Repeat what has acted, in a new world: the same calls give the same bits.

        A state that PyBullet saves is not enough: contacts that it restores go on differently.
        """
        self.place(history.start)
        targets = history.wheels_radps
        for period, wheels in enumerate(zip(targets[::2], targets[1::2], strict=True)):
            self.drive(wheels, history.people.get(period, {}))

    def close(self) -> None:
        """Leave PyBullet; a second call does nothing."""
        if self._client >= 0:
            pybullet.disconnect(self._client)
            self._client = -1

    def _build(self) -> None:
        self.close()
        self._client = pybullet.connect(pybullet.DIRECT)
        try:
            self._add_bodies(self._client)
        except BaseException:
            self.close()
            raise

    def _add_bodies(self, client: int) -> None:
        pybullet.setGravity(0, 0, -_GRAVITY_MPS2, physicsClientId=client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=self._substep_s,
            numSubSteps=0,
            numSolverIterations=_SOLVER_ITERATIONS,
            contactERP=_CONTACT_ERP,
            # With a cone, sideways forces between the wheels use up the friction of forward ones.
            enableConeFriction=0,
            deterministicOverlappingPairs=1,
            physicsClientId=client,
        )
        plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
        self._floor: int = pybullet.createMultiBody(0.0, plane, physicsClientId=client)
        pybullet.changeDynamics(
            self._floor, -1, lateralFriction=_FLOOR_FRICTION, physicsClientId=client
        )
        self._walls = {add_wall(client, *segment) for segment in self._scenario.wall_segments_m}
        self._robot = self._load_robot()
        self._require_footprint()
        self.people = PeopleBodies(
            client,
            min(self._scenario.pedestrians.count, MOST_NEAR),
            self._person_radius_m,
            apart_from=(self._floor, *self._walls),
        )

    def _load_robot(self) -> int:
        drive, client = self._drive, self._client
        body = load_urdf(client, drive.path, flags=pybullet.URDF_USE_INERTIA_FROM_FILE)
        root = pybullet.getBodyInfo(body, client)[0].decode()
        links = {root: -1}
        joints = {}
        for number in range(pybullet.getNumJoints(body, client)):
            information = pybullet.getJointInfo(body, number, client)
            joints[information[1].decode()] = number
            links[information[12].decode()] = number
        self._wheels = tuple(joints[name] for name in drive.wheel_joints)
        for name, link in links.items():
            friction = _WHEEL_FRICTION if link in self._wheels else 0.0
            frame = {"mass": _FRAME_MASS_KG, "localInertiaDiagonal": _FRAME_INERTIA_KGM2}
            pybullet.changeDynamics(
                body,
                link,
                lateralFriction=drive.friction.get(name, friction),
                restitution=0.0,
                physicsClientId=client,
                **(frame if name in drive.massless else {}),
            )
        let_move_freely(client, body)
        self._mass_in_root = pybullet.getDynamicsInfo(body, -1, client)[3:5]
        x, y, z, w = self._mass_in_root[1]
        self._root_turn = (-x, -y, -z, w)
        return body

    def _require_footprint(self) -> None:
        """The bodies of the robot lie within the scenario's radius."""
        links = range(-1, pybullet.getNumJoints(self._robot, self._client))
        boxes = [pybullet.getAABB(self._robot, link, self._client) for link in links]
        widest_m = max(abs(each) for low, high in boxes for each in (*low[:2], *high[:2]))
        radius_m = self._scenario.robot.radius_m
        if widest_m > radius_m + _FOOTPRINT_TOLERANCE_M:
            raise SimError(
                f"robot.radius_m must cover the robot of {self._drive.path}, which extends "
                f"{widest_m:.3f} m from its root link, got {radius_m:g} m; raise it"
            )

    def _set_base(self, pose: Pose) -> None:
        """Put the root link where the wheels touch the floor."""
        turn = (0.0, 0.0, math.sin(0.5 * pose[2]), math.cos(0.5 * pose[2]))
        root_m = (*pose[:2], self._wheel_radius_m - self._drive.axle_height_m)
        place = np.add(root_m, _rotated(turn, self._mass_in_root[0]))
        turn = _product(turn, self._mass_in_root[1])
        pybullet.resetBasePositionAndOrientation(self._robot, place, turn, self._client)

    def _set_velocity(self, start: Start) -> None:
        """Let the body move and the wheels, at angle 0, roll accordingly."""
        yaw_rad, yaw_rate_radps = start.pose[2], start.yaw_rate_radps
        velocity = (start.speed_mps * math.cos(yaw_rad), start.speed_mps * math.sin(yaw_rad), 0.0)
        turning = (0.0, 0.0, yaw_rate_radps)
        pybullet.resetBaseVelocity(self._robot, velocity, turning, self._client)
        for joint, sign, speed in zip(
            self._wheels, self._drive.turns_forward, self._rolling(start), strict=True
        ):
            pybullet.resetJointState(self._robot, joint, 0.0, sign * speed, self._client)

    def _rolling(self, start: Start) -> Wheels:
        """Speeds at which the wheels roll without slip."""
        half = 0.5 * self._drive.separation_m * start.yaw_rate_radps
        radius_m = self._wheel_radius_m
        return (start.speed_mps - half) / radius_m, (start.speed_mps + half) / radius_m

    def _turn_wheels(self, wheels_radps: Wheels) -> None:
        pybullet.setJointMotorControlArray(
            self._robot,
            self._wheels,
            pybullet.VELOCITY_CONTROL,
            targetVelocities=[
                sign * target
                for sign, target in zip(self._drive.turns_forward, wheels_radps, strict=True)
            ],
            forces=[self._torque_nm, self._torque_nm],
            physicsClientId=self._client,
        )

    def _add_contacts(self, impulses: Impulses) -> None:
        for contact in pybullet.getContactPoints(self._robot, physicsClientId=self._client):
            other, force_n = contact[2], contact[9]
            if other == self._floor or force_n <= 0.0:
                continue
            impulse = force_n * self._substep_s
            if other in self._walls:
                impulses.walls += impulse
            else:
                person = self.people.person_in(other)
                impulses.people[person] = impulses.people.get(person, 0.0) + impulse


def _yaw_of(turn: Quaternion) -> float:
    x, y, z, w = turn
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def _product(first: Quaternion, second: Quaternion) -> Quaternion:
    """first * second. PyBullet's own functions of transforms have single precision."""
    (ax, ay, az, aw), (bx, by, bz, bw) = first, second
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def _rotated(turn: Quaternion, vector: tuple[float, float, float]) -> tuple[float, float, float]:
    x, y, z, w = turn
    rotated = _product(_product(turn, (*vector, 0.0)), (-x, -y, -z, w))
    return rotated[:3]
