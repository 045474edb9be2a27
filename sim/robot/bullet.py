"""PyBullet, and the walls and files that its worlds share."""

import math
import os
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from serd_core.arrays import FloatArray
from sim.errors import SimError

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


def _import_pybullet() -> Any:
    """The pybullet module, which reports its build time on import."""
    with _silent():
        import pybullet
    return pybullet


pybullet = _import_pybullet()


def load_urdf(client: int, path: Path, **options: object) -> int:
    """Add the body of a URDF; SimError where PyBullet cannot."""
    try:
        with _silent():
            body: int = pybullet.loadURDF(str(path), physicsClientId=client, **options)
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


def add_wall(client: int, start_m: FloatArray, end_m: FloatArray) -> int:
    """Add a fixed box whose face towards the left of start -> end lies on the segment."""
    along = end_m - start_m
    length = float(np.hypot(*along))
    outwards = np.array([along[1], -along[0]]) / length
    middle = 0.5 * (start_m + end_m) + 0.5 * _WALL_THICKNESS_M * outwards
    half = (0.5 * length, 0.5 * _WALL_THICKNESS_M, 0.5 * _WALL_HEIGHT_M)
    shape = pybullet.createCollisionShape(
        pybullet.GEOM_BOX, halfExtents=half, physicsClientId=client
    )
    yaw = math.atan2(along[1], along[0])
    body: int = pybullet.createMultiBody(
        0.0,
        shape,
        -1,
        (float(middle[0]), float(middle[1]), half[2]),
        (0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw)),
        physicsClientId=client,
    )
    return body


def let_move_freely(client: int, body: int) -> None:
    """No damping by the air, no sleep. PyBullet ignores other values in a call that has these."""
    pybullet.changeDynamics(
        body,
        -1,
        linearDamping=0.0,
        angularDamping=0.0,
        activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING,
        physicsClientId=client,
    )
