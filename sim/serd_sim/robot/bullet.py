"""PyBullet, and the walls, files and sliding bodies that its worlds share.

A world is a `BulletClient`, which has PyBullet's functions as methods.
"""

import math
import os
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterator
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
_ALONG_X, _ALONG_Y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
#: Mass of the link between the two joints.
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


def add_sliding(
    client: BulletClient, base_m: tuple[float, float, float], shape: int, mass_kg: float
) -> int:
    """Add a body that slides along x and y, by two joints from a fixed base."""
    body: int = client.createMultiBody(
        0.0,
        basePosition=base_m,
        linkMasses=[_CARRIAGE_KG, mass_kg],
        linkCollisionShapeIndices=[-1, shape],
        linkVisualShapeIndices=[-1, -1],
        linkPositions=[_HERE] * 2,
        linkOrientations=[_LEVEL] * 2,
        linkInertialFramePositions=[_HERE] * 2,
        linkInertialFrameOrientations=[_LEVEL] * 2,
        linkParentIndices=range(2),
        linkJointTypes=[pybullet.JOINT_PRISMATIC] * 2,
        linkJointAxis=[_ALONG_X, _ALONG_Y],
    )
    let_move_freely(client, body)
    return body


def let_move_freely(client: BulletClient, body: int) -> None:
    """No damping by the air, no sleep. PyBullet ignores other values in a call that has these."""
    awake = pybullet.ACTIVATION_STATE_DISABLE_SLEEPING
    client.changeDynamics(body, -1, linearDamping=0.0, angularDamping=0.0, activationState=awake)


def turned(yaw_rad: float) -> tuple[float, float, float, float]:
    """The quaternion of a turn about z."""
    return 0.0, 0.0, math.sin(0.5 * yaw_rad), math.cos(0.5 * yaw_rad)


def close(client: BulletClient) -> None:
    """Leave a world; a second call does nothing."""
    if client.isConnected():
        client.disconnect()
