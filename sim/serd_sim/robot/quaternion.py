"""Unit quaternions (x, y, z, w), in double precision: PyBullet's own functions have single."""

import math

import numpy as np

from serd_core.arrays import FloatArray

Quaternion = tuple[float, float, float, float]
Vector = tuple[float, float, float]


def product(first: Quaternion, second: Quaternion) -> Quaternion:
    """first * second."""
    (ax, ay, az, aw), (bx, by, bz, bw) = first, second
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def conjugate(turn: Quaternion) -> Quaternion:
    """The inverse turn."""
    x, y, z, w = turn
    return -x, -y, -z, w


def rotated(turn: Quaternion, vector: Vector) -> Vector:
    """The vector after the turn."""
    x, y, z, _ = product(product(turn, (*vector, 0.0)), conjugate(turn))
    return x, y, z


def of_roll_pitch_yaw(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Quaternion:
    """The turns about the fixed axes x, y and z, in this order.

    SciPy has it as well, but `scipy.spatial` takes 0.2 s of every node's start to import.
    """
    halves = 0.5 * roll_rad, 0.5 * pitch_rad, 0.5 * yaw_rad
    (x, roll), (y, pitch), (z, yaw) = ((math.sin(half), math.cos(half)) for half in halves)
    return product((0.0, 0.0, z, yaw), product((0.0, y, 0.0, pitch), (x, 0.0, 0.0, roll)))


def matrix_of(turn: Quaternion) -> FloatArray:
    """(3, 3) rotation matrix."""
    axes = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    return np.array([rotated(turn, axis) for axis in axes]).T


def yaw_of(turn: Quaternion) -> float:
    """Heading in the plane."""
    x, y, z, w = turn
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
