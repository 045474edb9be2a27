"""Rigid bodies under gravity: a robot on driven wheels, walls, and people whom it can touch.

A person is an upright capsule on two prismatic joints without motors: it keeps its velocity unless
the robot pushes it, and it pushes the robot. Walls and other people act on people in the crowd's
model alone. A world is built anew for each start, because contacts carry hidden state from substep
to substep, which only a new world is free of.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from serd_core.arrays import FloatArray
from sim.errors import SimError
from sim.robot.bullet import add_wall, load_urdf, pybullet
from sim.scenario.scenario import Scenario

Pose = tuple[float, float, float]
Velocity = tuple[float, float]
Wheels = tuple[float, float]
Moving = tuple[tuple[float, float], Velocity]
Quaternion = tuple[float, float, float, float]

#: Mean of adults.
PERSON_MASS_KG = 75.0
_GRAVITY_MPS2 = 9.81
_LONGEST_SUBSTEP_S = 0.005
_SOLVER_ITERATIONS = 20
#: Share of a penetration that a substep corrects. The correction is a velocity: the default of 0.2
#: makes bodies bounce off that walk into each other.
_CONTACT_ERP = 0.02
_FLOOR_FRICTION, _WHEEL_FRICTION, _PERSON_FRICTION = 1.0, 0.8, 0.3
_SETTLING_S = 0.3
#: People who are this close to the robot's surface at the start of a control period may touch it.
_REACH_M = 0.3
_MOST_NEAR = 12
#: The capsule reaches below the floor, so that its side is a cylinder down to the floor.
_PERSON_SIDE_M = 1.5
_OUT_OF_THE_WAY_M = 1000.0
_FOOTPRINT_TOLERANCE_M = 0.02
_NO_COLLISION = 0
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
class Period:
    """What acts during a control period.

    The wheels' target speeds change linearly from those before to those after. people: position
    and velocity at its beginning of those who are near.
    """

    wheels_before: Wheels
    wheels_after: Wheels
    people: Mapping[int, Moving] = field(default_factory=dict)


History = tuple[Start, tuple[Period, ...]]


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
        radius_m = self._drive.radius_m or settings.wheel_radius_m
        assert radius_m is not None  # by the settings
        self._wheel_radius_m = radius_m
        self._torque_nm = settings.wheel_torque_nm
        self._n_substeps = math.ceil(scenario.control_period_s / _LONGEST_SUBSTEP_S - 1e-9)
        self._substep_s = scenario.control_period_s / self._n_substeps
        self._reach_m = settings.radius_m + person_radius_m + _REACH_M
        #: The person in each capsule that is in use.
        self._near: dict[int, int] = {}
        self._start: Start | None = None
        self._periods: list[Period] = []
        self._client = -1
        self._build()

    def place(self, start: Start) -> None:
        """Put the robot on the floor of a new world and give it a velocity."""
        self._start, self._periods = start, []
        self._build()
        self._set_base(start.pose)
        self._turn_wheels((0.0, 0.0))
        for _ in range(math.ceil(_SETTLING_S / self._substep_s)):
            pybullet.stepSimulation(self._client)
        self._set_velocity(start)

    def drive(self, period: Period, *, near_walls: bool = False) -> Impulses:
        """Advance by one control period; contacts with walls count when `near_walls`."""
        self._periods.append(period)
        self._set_people(period.people)
        impulses = Impulses()
        watched = near_walls or bool(self._near)
        for substep in range(1, self._n_substeps + 1):
            share = substep / self._n_substeps
            left, right = (
                before + share * (after - before)
                for before, after in zip(period.wheels_before, period.wheels_after, strict=True)
            )
            self._turn_wheels((left, right))
            pybullet.stepSimulation(self._client)
            if watched:
                self._add_contacts(impulses)
        return impulses

    def near_people(
        self, robot: Pose, positions_m: FloatArray, velocities_mps: FloatArray
    ) -> dict[int, Moving]:
        """Those of the (N, 2) people who may touch the robot in the next control period."""
        away = np.hypot(positions_m[:, 0] - robot[0], positions_m[:, 1] - robot[1])
        near = np.flatnonzero(away < self._reach_m)
        nearest = near[np.argsort(away[near], kind="stable")][: len(self._slots)].tolist()
        return {
            person: (_pair(positions_m[person]), _pair(velocities_mps[person]))
            for person in nearest
        }

    def person(self, person: int) -> tuple[Velocity, Velocity]:
        """Position and velocity of a person who is near."""
        slot = next(slot for slot, each in self._near.items() if each == person)
        states = pybullet.getJointStates(self._slots[slot], (0, 1), self._client)
        (x_m, vx_mps, *_), (y_m, vy_mps, *_) = states
        return (x_m, y_m), (vx_mps, vy_mps)

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
        """All that has happened since the robot was placed."""
        assert self._start is not None
        return self._start, tuple(self._periods)

    def load(self, history: History) -> None:
        """Repeat what has happened, in a new world: the same calls give the same bits.

        A state that PyBullet saves is not enough: contacts that it restores go on differently.
        """
        start, periods = history
        self.place(start)
        for period in periods:
            self.drive(period)

    def close(self) -> None:
        """Leave PyBullet; a second call does nothing."""
        if self._client >= 0:
            pybullet.disconnect(self._client)
            self._client = -1

    def _build(self) -> None:
        self.close()
        self._client = client = pybullet.connect(pybullet.DIRECT)
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
        self._slots = self._add_people()
        self._near.clear()

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
        self._let_move_freely(body)
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

    def _add_people(self) -> list[int]:
        count = min(self._scenario.pedestrians.count, _MOST_NEAR)
        if not count:
            return []
        capsule = pybullet.createCollisionShape(
            pybullet.GEOM_CAPSULE,
            radius=self._person_radius_m,
            height=_PERSON_SIDE_M,
            physicsClientId=self._client,
        )
        people = [self._add_person(slot, capsule) for slot in range(count)]
        for body in people:
            for other in (self._floor, *self._walls):
                self._separate(body, other, -1)
            for other in people[: people.index(body)]:
                self._separate(body, other, 1)
        return people

    def _add_person(self, slot: int, capsule: int) -> int:
        here, level = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)
        body: int = pybullet.createMultiBody(
            0.0,
            basePosition=(0.0, 0.0, 0.5 * _PERSON_SIDE_M),
            linkMasses=(_FRAME_MASS_KG, PERSON_MASS_KG),
            linkCollisionShapeIndices=(-1, capsule),
            linkVisualShapeIndices=(-1, -1),
            linkPositions=(here, here),
            linkOrientations=(level, level),
            linkInertialFramePositions=(here, here),
            linkInertialFrameOrientations=(level, level),
            linkParentIndices=(0, 1),
            linkJointTypes=(pybullet.JOINT_PRISMATIC, pybullet.JOINT_PRISMATIC),
            linkJointAxis=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
            physicsClientId=self._client,
        )
        for joint in (0, 1):
            pybullet.setJointMotorControl2(
                body, joint, pybullet.VELOCITY_CONTROL, force=0.0, physicsClientId=self._client
            )
            pybullet.changeDynamics(
                body,
                joint,
                lateralFriction=_PERSON_FRICTION,
                restitution=0.0,
                physicsClientId=self._client,
            )
        self._let_move_freely(body)
        for joint, place_m in enumerate(_aside(slot)):
            pybullet.resetJointState(body, joint, place_m, 0.0, self._client)
        return body

    def _let_move_freely(self, body: int) -> None:
        """No damping by the air, no sleep; of the base alone, whose call ignores other values."""
        pybullet.changeDynamics(
            body,
            -1,
            linearDamping=0.0,
            angularDamping=0.0,
            activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING,
            physicsClientId=self._client,
        )

    def _separate(self, person: int, other: int, link: int) -> None:
        pybullet.setCollisionFilterPair(
            person, other, 1, link, _NO_COLLISION, physicsClientId=self._client
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
        half = 0.5 * self._drive.separation_m * yaw_rate_radps
        for joint, sign, rolled in zip(
            self._wheels,
            self._drive.turns_forward,
            (start.speed_mps - half, start.speed_mps + half),
            strict=True,
        ):
            pybullet.resetJointState(
                self._robot, joint, 0.0, sign * rolled / self._wheel_radius_m, self._client
            )

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

    def _set_people(self, people: Mapping[int, Moving]) -> None:
        """Move people into capsules; one who is still near keeps the capsule."""
        for slot in [slot for slot, person in self._near.items() if person not in people]:
            del self._near[slot]
            self._set_person(slot, _aside(slot), (0.0, 0.0))
        placed = {person: slot for slot, person in self._near.items()}
        free = (slot for slot in range(len(self._slots)) if slot not in self._near)
        for person, (place_m, velocity_mps) in people.items():
            slot = placed[person] if person in placed else next(free)
            self._near[slot] = person
            self._set_person(slot, place_m, velocity_mps)

    def _set_person(self, slot: int, place_m: Velocity, velocity_mps: Velocity) -> None:
        for joint in (0, 1):
            pybullet.resetJointState(
                self._slots[slot], joint, place_m[joint], velocity_mps[joint], self._client
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
                person = self._near[self._slots.index(other)]
                impulses.people[person] = impulses.people.get(person, 0.0) + impulse


def _aside(slot: int) -> Velocity:
    """Where a capsule is that no person is in."""
    return _OUT_OF_THE_WAY_M, 3.0 * slot


def _pair(row: FloatArray) -> Velocity:
    return float(row[0]), float(row[1])


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
