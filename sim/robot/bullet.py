"""PyBullet, and the walls that its worlds share."""

import math
import os
import sys
from typing import Any

import numpy as np

from serd_core.arrays import FloatArray

_STANDARD_ERROR = 2
_WALL_THICKNESS_M = 0.1
_WALL_HEIGHT_M = 0.8


def _import_pybullet() -> Any:
    """The pybullet module; what its import writes to standard error is thrown away."""
    sys.stderr.flush()
    kept = os.dup(_STANDARD_ERROR)
    null = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, _STANDARD_ERROR)
        import pybullet
    finally:
        os.dup2(kept, _STANDARD_ERROR)
        os.close(kept)
        os.close(null)
    return pybullet


pybullet = _import_pybullet()


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
