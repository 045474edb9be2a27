"""The observation of one control tick.

Yaw and the people's positions and velocities are rounded to single precision, as the messages that
carry them are, so that a planner behind ROS sees bit for bit what a planner in process sees.
"""

import math
from dataclasses import dataclass
from typing import Any

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
    """State of the robot and the people around it.

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

    def __post_init__(self) -> None:
        x_m, y_m, yaw_rad = map(float, self.pose)
        position, velocity = map(
            _single_precision, (self.people_position_m, self.people_velocity_mps)
        )
        identity = np.array(self.people_id, dtype=np.int64)
        if not len(position) == len(velocity) == len(identity):
            raise SimError(
                "people_position_m, people_velocity_mps and people_id must be of one length, got "
                f"{len(position)}, {len(velocity)} and {len(identity)}; send one row per person"
            )
        values = {"pose": (x_m, y_m, float(np.float32(yaw_rad))), "people_id": identity}
        values |= {"people_position_m": position, "people_velocity_mps": velocity}
        for name, value in values.items():
            object.__setattr__(self, name, value)

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


def _single_precision(values: ArrayLike) -> FloatArray:
    rounded = np.asarray(values, dtype=np.float32).astype(np.float64)
    return rounded.reshape(-1, 2)


def is_next_episode(last: Observation, observation: Observation, control_period_s: float) -> bool:
    """Whether an episode began in between; a live clock may skip a few ticks."""
    n_ticks = round(0.5 * EPISODE_GAP_S / control_period_s)
    return not 0 <= observation.tick - last.tick <= n_ticks


#: What a stream is for; part of its key, so that no two of them share numbers.
CROWD, START, EXPERT, POLICY, LIDAR, ODOMETRY, FAULT = range(7)


def episode_rng(seed: int, episode: int, purpose: int, *more: int) -> np.random.Generator:
    """Generator for one purpose in one episode: the same for the same numbers, always."""
    return np.random.default_rng(np.random.SeedSequence([seed, episode, purpose, *more]))


class ObservationInbox:
    """Keeps the newest pose, speeds and people, each with its stamp (ns).

    tolerance_s: 0 gives an observation once per stamp, when all its parts have that stamp, as a
    simulator stamps them. Above 0, each pose gives an observation with the newest other parts,
    whose stamps may be this far from its own, as on robots whose sensors run apart.
    needs_people: when False, observations have no people and wait for pose and speeds only.
    """

    def __init__(
        self, control_period_s: float, *, needs_people: bool = True, tolerance_s: float = 0.0
    ) -> None:
        self._needs_people = needs_people
        self._tolerance_ns = round(tolerance_s * 1e9)
        self._control_period_s = control_period_s
        #: Stamp (ns) and value of each part that has come, by the name of its topic.
        self._parts: dict[str, tuple[int, Any]] = {}

    def take_pose(self, time_ns: int, pose: Pose) -> Observation | None:
        """Take a pose; the observation it completes, if it does."""
        return self._take("pose", time_ns, pose)

    def take_speeds(self, time_ns: int, speeds: tuple[float, float]) -> Observation | None:
        """Take speeds (m/s, rad/s); the observation they complete, if they do."""
        return self._take("odom", time_ns, speeds)

    def take_people(self, time_ns: int, people: People) -> Observation | None:
        """Take the people; the observation they complete, if they do."""
        return self._take("people", time_ns, people) if self._needs_people else None

    def missing(self) -> dict[str, float | None]:
        """The parts that no observation can be made without: None for one that has never come,
        else by how much (s) it is older than the pose; negative when newer."""
        found: dict[str, float | None] = {}
        posed_ns, _ = self._parts.get("pose", (None, None))
        for name in ("pose", "odom", "people") if self._needs_people else ("pose", "odom"):
            stamp_ns, _ = self._parts.get(name, (None, None))
            if stamp_ns is None:
                found[name] = None
            elif posed_ns is not None and abs(posed_ns - stamp_ns) > self._tolerance_ns:
                found[name] = (posed_ns - stamp_ns) * 1e-9
        return found

    def _take(self, name: str, time_ns: int, value: Any) -> Observation | None:
        self._parts[name] = time_ns, value
        if self.missing() or (self._tolerance_ns and name != "pose"):
            return None
        posed_ns, pose = self._parts["pose"]
        _, (speed_mps, yaw_rate_radps) = self._parts["odom"]
        _, people = self._parts.get("people", (0, NO_PEOPLE))
        time_s = posed_ns * 1e-9
        return Observation(
            time_s=time_s,
            tick=round(time_s / self._control_period_s),
            pose=pose,
            speed_mps=speed_mps,
            yaw_rate_radps=yaw_rate_radps,
            people_position_m=people.position_m,
            people_velocity_mps=people.velocity_mps,
            people_id=people.identity,
        )
