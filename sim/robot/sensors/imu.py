"""An inertial measurement unit at the robot's centre: means over a control period of length h.

With the orientation R and the velocity v of the robot, the gyroscope and the accelerometer measure

    w = log(R0^T R1) / h + b_w + n_w,   a = R^T ((v1 - v0) / h + g z) + b_a + n_a

where R is the orientation in the middle. Noise n is normal with deviation density / sqrt(h); biases
b begin at 0 and walk by walk * sqrt(h) in each period (Woodman, UCAM-CL-TR-696, 2007).
"""

import math
from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray
from sim.robot.quaternion import Quaternion, Vector, conjugate, product, rotated
from sim.scenario.settings import ImuSettings

GRAVITY_MPS2 = 9.81


@dataclass(frozen=True)
class Inertial:
    """Orientation in the map, and velocity of the robot's centre."""

    turn: Quaternion
    velocity_mps: Vector


@dataclass(frozen=True)
class ImuReading:
    """In the robot's frame: x ahead, y to the left, z up."""

    angular_velocity_radps: Vector
    acceleration_mps2: Vector


class Imu:
    """The readings of an episode; `reading` is the last one."""

    def __init__(
        self, settings: ImuSettings, period_s: float, start: Inertial, rng: np.random.Generator
    ) -> None:
        self._period_s, self._rng, self._last = period_s, rng, start
        rate, force = settings.noise_deviations(period_s)
        self._noise: FloatArray = np.repeat([rate, force], 3)
        walks = settings.gyroscope_bias_walk, settings.accelerometer_bias_walk
        self._walk: FloatArray = np.repeat(walks, 3) * math.sqrt(period_s)
        self._bias: FloatArray = np.zeros(6)
        self.reading = self._measured(start)

    def follow(self, now: Inertial) -> None:
        """Take the motion at the end of the next control period."""
        self.reading = self._measured(now)
        self._last = now

    def _measured(self, now: Inertial) -> ImuReading:
        normal = self._rng.standard_normal((2, 6))
        self._bias = self._bias + self._walk * normal[0]
        error = (self._bias + self._noise * normal[1]).tolist()
        true = (*self._angular_velocity(now), *self._acceleration(now))
        x, y, z, along, left, up = (value + more for value, more in zip(true, error, strict=True))
        return ImuReading((x, y, z), (along, left, up))

    def _angular_velocity(self, now: Inertial) -> Vector:
        x, y, z, w = product(conjugate(self._last.turn), now.turn)
        sine = math.hypot(x, y, z)
        angle = 2.0 * math.atan2(sine, abs(w)) * math.copysign(1.0, w)
        scale = angle / (max(sine, 1e-300) * self._period_s)
        return scale * x, scale * y, scale * z

    def _acceleration(self, now: Inertial) -> Vector:
        x, y, z = (
            (new - old) / self._period_s
            for new, old in zip(now.velocity_mps, self._last.velocity_mps, strict=True)
        )
        return rotated(conjugate(_middle(self._last.turn, now.turn)), (x, y, z + GRAVITY_MPS2))


def _middle(first: Quaternion, second: Quaternion) -> Quaternion:
    """The orientation halfway between two."""
    near = math.copysign(1.0, sum(a * b for a, b in zip(first, second, strict=True)))
    x, y, z, w = (a + near * b for a, b in zip(first, second, strict=True))
    length = math.hypot(x, y, z, w)
    return x / length, y / length, z / length, w / length
