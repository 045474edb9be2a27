"""Rigid bodies under gravity: a robot on driven wheels, walls, and people whom it can touch.

A world is built anew for each start, because contacts carry hidden state from substep to substep,
which only a new world is free of.
"""

import math
from array import array
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from serd_sim.errors import SimError
from serd_sim.robot.bullet import (
    BulletClient,
    add_wall,
    close,
    let_move_freely,
    load_urdf,
    new_world,
    pybullet,
    turned,
)
from serd_sim.robot.people_bodies import Moving, PeopleBodies, Velocity
from serd_sim.robot.quaternion import Quaternion, Vector, conjugate, product, rotated, yaw_of
from serd_sim.robot.robot import RobotState, standing_at
from serd_sim.scenario.scenario import Scenario

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
#: Of a link without <inertial>, for which PyBullet would assume 1 kg.
_FRAME_MASS_KG, _FRAME_INERTIA_KGM2 = 1e-3, (1e-6, 1e-6, 1e-6)


@dataclass(frozen=True)
class History:
    """What has acted since the start: wheel targets of each control period, people of some."""

    start: RobotState
    wheels_radps: tuple[float, ...]
    people: Mapping[int, Mapping[int, Moving]]


@dataclass(frozen=True)
class PhysicalState(RobotState):
    """Where the root link of a robot on wheels is, and what else a snapshot keeps.

    velocity_mps: of the root link's centre of mass. target: commanded (v, w) after the limits.
    history: what `Dynamics.load` takes, in snapshots.
    """

    velocity_mps: Velocity = (0.0, 0.0)
    wheels_rad: Wheels = (0.0, 0.0)
    target: tuple[float, float] = (0.0, 0.0)
    history: History | None = field(default=None, repr=False)


@dataclass
class Impulses:
    """Normal impulses (N s) on the robot during a control period, by who exerts them."""

    walls_ns: float = 0.0
    people_ns: dict[int, float] = field(default_factory=dict)


class Dynamics:
    """The bodies of one scenario. Call `place` or `load` before anything else."""

    def __init__(self, scenario: Scenario, person_radius_m: float) -> None:
        settings = scenario.robot
        self._scenario, self._person_radius_m = scenario, person_radius_m
        self._drive = settings.differential_drive()
        self._wheel_radius_m = settings.rolling_radius_m(self._drive)
        self._torques_nm = (settings.wheel_torque_nm, settings.wheel_torque_nm)
        self._n_substeps = math.ceil(scenario.control_period_s / _LONGEST_SUBSTEP_S - 1e-9)
        self._substep_s = scenario.control_period_s / self._n_substeps
        self._start = standing_at((0.0, 0.0, 0.0))
        self._target: Wheels = (0.0, 0.0)
        self._wheel_log = array("d")
        self._people_log: dict[int, Mapping[int, Moving]] = {}
        self._client: BulletClient = None
        self._build()  # so that a robot that does not fit is rejected now

    def place(self, start: RobotState) -> None:
        """Put the robot on the floor of a new world and give it a velocity."""
        self._start, self._wheel_log, self._people_log = start, array("d"), {}
        self._build()
        turn = turned(start.pose[2])
        root_m = (start.x_m, start.y_m, self._wheel_radius_m - self._drive.axle_height_m)
        place = np.add(root_m, rotated(turn, self._mass_in_root[0]))
        turn = product(turn, self._mass_in_root[1])
        self._client.resetBasePositionAndOrientation(self._robot, place, turn)
        self._turn_wheels((0.0, 0.0))
        for _ in range(math.ceil(_SETTLING_S / self._substep_s)):
            self._client.stepSimulation()
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
        (left, right), self._target = self._target, wheels_radps
        more_left, more_right = wheels_radps[0] - left, wheels_radps[1] - right
        self.people.place(people)
        impulses = Impulses()
        for substep in range(1, self._n_substeps + 1):
            share = substep / self._n_substeps
            self._turn_wheels((left + share * more_left, right + share * more_right))
            self._step()
            if near_walls or people:
                self._add_contacts(impulses)
        return impulses

    def state(self, target: tuple[float, float] = (0.0, 0.0)) -> PhysicalState:
        """Where the robot is and how it moves; target: that of the state."""
        (x_m, y_m, _), turn = self._root()
        (vx_mps, vy_mps, _), rates = self._client.getBaseVelocity(self._robot)
        yaw_rad = yaw_of(turn)
        wheels = self._client.getJointStates(self._robot, self._wheels)
        left, right = (
            sign * state[0] for sign, state in zip(self._drive.turns_forward, wheels, strict=True)
        )
        return PhysicalState(
            x_m,
            y_m,
            (math.sin(0.5 * yaw_rad), math.cos(0.5 * yaw_rad)),
            vx_mps * math.cos(yaw_rad) + vy_mps * math.sin(yaw_rad),
            rates[2],
            (vx_mps, vy_mps),
            (left, right),
            target,
        )

    def _root(self) -> tuple[Vector, Quaternion]:
        """Position and orientation of the root link."""
        place, turn = self._client.getBasePositionAndOrientation(self._robot)
        turn = product(turn, self._root_turn)
        x, y, z = rotated(turn, self._mass_in_root[0])
        return (place[0] - x, place[1] - y, place[2] - z), turn

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
        if self._client is not None:
            close(self._client)

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
        self._walls = {add_wall(client, *segment) for segment in self._scenario.wall_segments_m}
        self._robot = self._load_robot(client)
        self._require_footprint()
        self.people = PeopleBodies(
            client, self._person_radius_m, apart_from=(self._floor, *self._walls)
        )

    def _load_robot(self, client: BulletClient) -> int:
        drive = self._drive
        body = load_urdf(client, drive.path, flags=pybullet.URDF_USE_INERTIA_FROM_FILE)
        root = client.getBodyInfo(body)[0].decode()
        links = {root: -1}
        joints = {}
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
                lateralFriction=drive.friction.get(name, friction),
                restitution=0.0,
                **(frame if name in drive.massless else {}),
            )
        let_move_freely(client, body)
        self._mass_in_root = client.getDynamicsInfo(body, -1)[3:5]
        self._root_turn = conjugate(self._mass_in_root[1])
        return body

    def _require_footprint(self) -> None:
        """The bodies of the robot lie within the scenario's radius."""
        links = range(-1, self._client.getNumJoints(self._robot))
        boxes = [self._client.getAABB(self._robot, link) for link in links]
        widest_m = max(abs(each) for low, high in boxes for each in (*low[:2], *high[:2]))
        radius_m = self._scenario.robot.radius_m
        if widest_m > radius_m + _FOOTPRINT_TOLERANCE_M:
            raise SimError(
                f"robot.radius_m must cover the robot of {self._drive.path}, which extends "
                f"{widest_m:.3f} m from its root link, got {radius_m:g} m; raise it"
            )

    def _set_velocity(self, start: RobotState) -> None:
        """Let the body move and the wheels, at angle 0, roll accordingly."""
        yaw_rad, yaw_rate_radps = start.pose[2], start.yaw_rate_radps
        velocity = (start.speed_mps * math.cos(yaw_rad), start.speed_mps * math.sin(yaw_rad), 0.0)
        turning = (0.0, 0.0, yaw_rate_radps)
        self._client.resetBaseVelocity(self._robot, velocity, turning)
        for joint, sign, speed in zip(
            self._wheels, self._drive.turns_forward, self._rolling(start), strict=True
        ):
            self._client.resetJointState(self._robot, joint, 0.0, sign * speed)

    def _rolling(self, start: RobotState) -> Wheels:
        """Speeds at which the wheels roll without slip."""
        half = 0.5 * self._drive.separation_m * start.yaw_rate_radps
        radius_m = self._wheel_radius_m
        return (start.speed_mps - half) / radius_m, (start.speed_mps + half) / radius_m

    def _turn_wheels(self, wheels_radps: Wheels) -> None:
        left, right = self._drive.turns_forward
        self._set_motors(
            self._robot,
            self._wheels,
            pybullet.VELOCITY_CONTROL,
            targetVelocities=(left * wheels_radps[0], right * wheels_radps[1]),
            forces=self._torques_nm,
        )

    def _add_contacts(self, impulses: Impulses) -> None:
        for contact in self._client.getContactPoints(self._robot):
            other, force_n = contact[2], contact[9]
            if other == self._floor or force_n <= 0.0:
                continue
            impulse_ns = force_n * self._substep_s
            if other in self._walls:
                impulses.walls_ns += impulse_ns
            else:
                person = self.people.person_in(other)
                impulses.people_ns[person] = impulses.people_ns.get(person, 0.0) + impulse_ns
