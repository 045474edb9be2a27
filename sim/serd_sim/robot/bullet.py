"""PyBullet, and the walls, files and sliding bodies that its worlds share.

A world is a `BulletClient`, which has PyBullet's functions as methods.
"""

import math
import os
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from serd_core.arrays import FloatArray
from serd_sim.errors import SimError

_STANDARD_OUTPUT, _STANDARD_ERROR = 1, 2
_WALL_THICKNESS_M = 0.1
_WALL_HEIGHT_M = 0.8


@contextmanager
def _silent() -> Iterator[None]:
    """Throw away what PyBullet itself writes to the terminal."""
    sys.stdout.flush()
    sys.stderr.flush()
    kept = [(stream, os.dup(stream)) for stream in (_STANDARD_OUTPUT, _STANDARD_ERROR)]
    null = os.open(os.devnull, os.O_WRONLY)
    try:
        for stream, _ in kept:
            os.dup2(null, stream)
        yield
    finally:
        for stream, copy in kept:
            os.dup2(copy, stream)
            os.close(copy)
        os.close(null)


with _silent():  # pybullet reports its build time on import
    import pybullet as pybullet
    from pybullet_utils.bullet_client import BulletClient as BulletClient

_HERE, _LEVEL = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)
#: Mass of the link between the two joints along which a person slides.
_CARRIAGE_KG = 1e-3


def new_world() -> BulletClient:
    """An empty world."""
    with _silent():
        return BulletClient(pybullet.DIRECT)


def load_urdf(client: BulletClient, path: Path, **options: object) -> int:
    """Add the body of a URDF; SimError where PyBullet cannot."""
    try:
        with _silent():
            body: int = client.loadURDF(str(path), **options)
    except pybullet.error as error:
        missing = ", ".join(_missing_meshes(path))
        reason = f"there is no {missing}; add it" if missing else f"{error}; check its files"
        raise SimError(f"{path} must load in PyBullet, but does not: {reason}") from None
    return body


def _missing_meshes(path: Path) -> list[str]:
    """Meshes of a URDF that no folder above it has, where PyBullet looks for them."""
    try:
        names = {mesh.get("filename") or "" for mesh in ET.parse(path).iter("mesh")} - {""}
    except ET.ParseError:
        return []
    folders = path.resolve().parents
    places = {name: name.removeprefix("package://").removeprefix("file://") for name in names}
    return sorted(name for name in names if not any((f / places[name]).is_file() for f in folders))


def add_wall(client: BulletClient, start_m: FloatArray, end_m: FloatArray) -> int:
    """Add a fixed box whose face towards the left of start -> end lies on the segment."""
    along = end_m - start_m
    length = float(np.hypot(*along))
    outwards = np.array([along[1], -along[0]]) / length
    middle = 0.5 * (start_m + end_m) + 0.5 * _WALL_THICKNESS_M * outwards
    half = (0.5 * length, 0.5 * _WALL_THICKNESS_M, 0.5 * _WALL_HEIGHT_M)
    shape = client.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half)
    place_m = (float(middle[0]), float(middle[1]), half[2])
    turn = turned(math.atan2(along[1], along[0]))
    body: int = client.createMultiBody(0.0, shape, -1, place_m, turn)
    return body


def let_move_freely(client: BulletClient, body: int) -> None:
    """No damping by the air, no sleep. PyBullet ignores other values in a call that has these."""
    awake = pybullet.ACTIVATION_STATE_DISABLE_SLEEPING
    client.changeDynamics(body, -1, linearDamping=0.0, angularDamping=0.0, activationState=awake)


def turned(yaw_rad: float) -> tuple[float, float, float, float]:
    """The quaternion of a turn about z."""
    return 0.0, 0.0, math.sin(0.5 * yaw_rad), math.cos(0.5 * yaw_rad)


Velocity = tuple[float, float]
#: Position and velocity.
Moving = tuple[tuple[float, float], Velocity]

MOST_NEAR = 12
#: Mean of adults.
PERSON_MASS_KG = 75.0
_CONTACT_FRICTION = 0.3
#: People who are this close to the robot's surface at the start of a control period of 0.05 s may
#: touch it; the distance grows with the period.
_REACH_M, _REACH_PERIOD_S = 0.3, 0.05
#: The capsule reaches below the floor, so that its side is a cylinder down to the floor.
_SIDE_M = 1.5
_OUT_OF_THE_WAY_M = 1000.0
_NO_COLLISION = 0


def near_people(
    away: FloatArray,
    reach_m: float,
    period_s: float,
    positions_m: FloatArray,
    velocities_mps: FloatArray,
) -> dict[int, Moving]:
    """Those of the (N, 2) people who may touch a body in the next control period.

    away: (N,) distances to it, of which those up to reach_m are contacts.
    """
    reach_m += _REACH_M * (period_s / _REACH_PERIOD_S)
    near = (away < reach_m).nonzero()[0]
    nearest = near[away[near].argsort(kind="stable")][:MOST_NEAR].tolist()
    return {
        person: (_pair(positions_m[person]), _pair(velocities_mps[person])) for person in nearest
    }


class PeopleBodies:
    """Capsules in a PyBullet world, none of which touches the bodies of `apart_from`."""

    def __init__(self, client: BulletClient, radius_m: float, *, apart_from: Iterable[int]) -> None:
        self._client, self._apart_from = client, tuple(apart_from)
        #: The person in each capsule that is in use.
        self._near: dict[int, int] = {}
        self._bodies: list[int] = []
        self._capsule: int = client.createCollisionShape(
            pybullet.GEOM_CAPSULE, radius=radius_m, height=_SIDE_M
        )

    def place(self, people: Mapping[int, Moving]) -> None:
        """Move people into capsules; one who is still near keeps the capsule."""
        for slot in [slot for slot, person in self._near.items() if person not in people]:
            del self._near[slot]
            self._set(slot, (_OUT_OF_THE_WAY_M, 3.0 * slot), (0.0, 0.0))
        placed = {person: slot for slot, person in self._near.items()}
        for person, (place_m, velocity_mps) in people.items():
            slot = placed[person] if person in placed else self._free_slot()
            self._near[slot] = person
            self._set(slot, place_m, velocity_mps)

    def motion(self, person: int) -> Moving:
        """Position and velocity of a person who is near."""
        slot = next(slot for slot, each in self._near.items() if each == person)
        (x_m, vx_mps, *_), (y_m, vy_mps, *_) = self._client.getJointStates(
            self._bodies[slot], (0, 1)
        )
        return (x_m, y_m), (vx_mps, vy_mps)

    def person_in(self, body: int) -> int:
        """The person in a capsule, by the number of its body."""
        return self._near[self._bodies.index(body)]

    def _free_slot(self) -> int:
        """A capsule that no person is in, a new one where there is none."""
        for slot in range(len(self._bodies)):
            if slot not in self._near:
                return slot
        body = self._client.createMultiBody(
            0.0,
            basePosition=(0.0, 0.0, 0.5 * _SIDE_M),
            linkMasses=[_CARRIAGE_KG, PERSON_MASS_KG],
            linkCollisionShapeIndices=[-1, self._capsule],
            linkVisualShapeIndices=[-1, -1],
            linkPositions=[_HERE] * 2,
            linkOrientations=[_LEVEL] * 2,
            linkInertialFramePositions=[_HERE] * 2,
            linkInertialFrameOrientations=[_LEVEL] * 2,
            linkParentIndices=range(2),
            linkJointTypes=[pybullet.JOINT_PRISMATIC] * 2,
            linkJointAxis=[(1.0, 0.0, 0.0), (0.0, 1.0, 0.0)],
        )
        let_move_freely(self._client, body)
        for joint in (0, 1):
            self._client.setJointMotorControl2(body, joint, pybullet.VELOCITY_CONTROL, force=0.0)
        self._client.changeDynamics(body, 1, lateralFriction=_CONTACT_FRICTION, restitution=0.0)
        for other in self._apart_from:
            self._client.setCollisionFilterPair(body, other, 1, -1, _NO_COLLISION)
        for other in self._bodies:
            self._client.setCollisionFilterPair(body, other, 1, 1, _NO_COLLISION)
        self._bodies.append(body)
        return len(self._bodies) - 1

    def _set(self, slot: int, place_m: Velocity, velocity_mps: Velocity) -> None:
        for joint in (0, 1):
            self._client.resetJointState(
                self._bodies[slot], joint, place_m[joint], velocity_mps[joint]
            )


def _pair(row: FloatArray) -> Velocity:
    return float(row[0]), float(row[1])
