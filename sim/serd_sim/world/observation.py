"""The observation of one control tick.

Yaw and the people's positions and velocities are rounded to single precision, as the messages that
carry them are, so that a planner behind ROS sees bit for bit what a planner in process sees.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from serd_core.arrays import FloatArray, IntArray
from serd_sim.errors import SimError

Pose = tuple[float, float, float]
#: Simulated time (s) between the end of an episode and the next one.
EPISODE_GAP_S = 4.0


@dataclass(frozen=True, eq=False)
class People:
    """position_m, velocity_mps: (N, 2); identity: (N,)."""

    position_m: FloatArray
    velocity_mps: FloatArray
    identity: IntArray


NO_PEOPLE = People(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0, dtype=np.int64))


@dataclass(frozen=True, eq=False)
class Observation:
    """State of the robot and the people around it; build it with `make_observation`.

    time_s, tick: simulated time and the number of control periods it is.
    pose: (x_m, y_m, yaw_rad) of the robot in the map, yaw in [-pi, pi].
    people_position_m, people_velocity_mps: (N, 2). people_id: (N,).
    """

    time_s: float
    tick: int
    pose: Pose
    speed_mps: float
    yaw_rate_radps: float
    people_position_m: FloatArray
    people_velocity_mps: FloatArray
    people_id: IntArray

    @property
    def is_finite(self) -> bool:
        """Whether pose and motion of the robot are finite numbers."""
        return all(map(math.isfinite, (*self.pose, self.speed_mps, self.yaw_rate_radps)))

    @property
    def people(self) -> People:
        """The people around the robot."""
        return People(self.people_position_m, self.people_velocity_mps, self.people_id)

    @property
    def x_m(self) -> float:
        """East coordinate of the robot."""
        return self.pose[0]

    @property
    def y_m(self) -> float:
        """North coordinate of the robot."""
        return self.pose[1]

    @property
    def yaw_rad(self) -> float:
        """Heading of the robot, counter-clockwise from east."""
        return self.pose[2]


def make_observation(
    *,
    time_s: float,
    tick: int,
    pose: tuple[float, float, float],
    speed_mps: float,
    yaw_rate_radps: float,
    people_position_m: ArrayLike,
    people_velocity_mps: ArrayLike,
    people_id: ArrayLike,
) -> Observation:
    """Observation with yaw and people rounded to what single-precision messages can carry."""
    position = _single_precision(people_position_m)
    velocity = _single_precision(people_velocity_mps)
    identity = np.array(people_id, dtype=np.int64)
    if not len(position) == len(velocity) == len(identity):
        raise SimError(
            "people_position_m, people_velocity_mps and people_id must be of one length, got "
            f"{len(position)}, {len(velocity)} and {len(identity)}; send one row per person"
        )
    return Observation(
        time_s=float(time_s),
        tick=int(tick),
        pose=(float(pose[0]), float(pose[1]), float(np.float32(pose[2]))),
        speed_mps=float(speed_mps),
        yaw_rate_radps=float(yaw_rate_radps),
        people_position_m=position,
        people_velocity_mps=velocity,
        people_id=identity,
    )


def _single_precision(values: ArrayLike) -> FloatArray:
    rounded = np.asarray(values, dtype=np.float32).astype(np.float64)
    return rounded.reshape(-1, 2)


def is_next_episode(last: Observation, observation: Observation, control_period_s: float) -> bool:
    """Whether an episode began in between; a live clock may skip a few ticks."""
    n_ticks = round(0.5 * EPISODE_GAP_S / control_period_s)
    return not 0 <= observation.tick - last.tick <= n_ticks
