"""The other robots of a world that several share, as one of them meets them."""

import math
from collections.abc import Callable

import numpy as np

from serd_core.arrays import FloatArray, IntArray
from sim.crowd.robots import RobotBody

_APART_M = 0.05


class OtherRobots:
    """What stands in a robot's way, is in its scan, and is among the people that it observes.

    bodies_now: the other robots as they are, by their number. n_contacts: how often in this episode
    the robot drove against another; minimum_distance_m: between hulls.
    """

    def __init__(self, bodies_now: Callable[[], tuple[tuple[int, RobotBody], ...]]) -> None:
        self._bodies_now = bodies_now
        self.begin()

    def begin(self) -> None:
        """A new episode."""
        self.n_contacts, self.minimum_distance_m, self._touching = 0, math.inf, False

    @property
    def bodies(self) -> tuple[RobotBody, ...]:
        """The other robots."""
        return tuple(body for _, body in self._bodies_now())

    def block(self, before: RobotBody, after: RobotBody) -> bool:
        """Whether a motion would end inside another robot, deeper than it began."""
        blocked, nearest_m = False, math.inf
        for other in self.bodies:
            gap_m = _gap_m(after, other)
            nearest_m = min(nearest_m, max(gap_m, 0.0))
            blocked |= gap_m < min(0.0, _gap_m(before, other))
        self.minimum_distance_m = min(self.minimum_distance_m, nearest_m)
        self.n_contacts += blocked and not self._touching
        self._touching = blocked or (self._touching and nearest_m < _APART_M)
        return blocked

    def appended_to(
        self, place_m: FloatArray, velocity_mps: FloatArray
    ) -> tuple[FloatArray, FloatArray, IntArray]:
        """(N, 2) places and velocities of people with those of the other robots; (N,) ids.

        The id of a robot is the number of people plus its number.
        """
        identity = np.arange(len(place_m))
        found = self._bodies_now()
        if not found:
            return place_m, velocity_mps, identity
        places = [(each.x_m, each.y_m) for _, each in found]
        velocities = [(each.velocity_x_mps, each.velocity_y_mps) for _, each in found]
        numbers = len(place_m) + np.array([number for number, _ in found])
        return (
            np.concatenate([place_m, places]),
            np.concatenate([velocity_mps, velocities]),
            np.concatenate([identity, numbers]),
        )


def _gap_m(one: RobotBody, other: RobotBody) -> float:
    """Distance between hulls, negative where they overlap."""
    distance_m = math.dist((one.x_m, one.y_m), (other.x_m, other.y_m))
    return distance_m - one.radius_m - other.radius_m
