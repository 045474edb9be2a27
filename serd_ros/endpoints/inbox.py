"""Puts one observation together from the messages that carry its parts."""

from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import PointCloud2

from serd_ros.convert.odometry import speeds_of
from serd_ros.convert.people import NOBODY, People, from_people_message
from serd_ros.convert.pose import from_pose
from serd_ros.convert.stamp import stamp_ns
from sim.world.observation import Observation, make_observation


class ObservationInbox:
    """Keeps the newest pose, odometry and people.

    The simulator stamps the three alike; `synchronised` gives an observation once per stamp, when
    all three parts of it are there. `latest` mixes stamps, for robots whose sensors run apart.
    needs_people: when False, observations hold nobody and wait for pose and odometry only.
    """

    def __init__(self, control_period_s: float, *, needs_people: bool = True) -> None:
        self._needs_people = needs_people
        self._control_period_s = control_period_s
        self._pose: tuple[int, tuple[float, float, float]] | None = None
        self._speeds: tuple[int, tuple[float, float]] | None = None
        self._people: tuple[int, People] | None = None

    def take_pose(self, message: PoseStamped) -> Observation | None:
        """Take a pose; the observation it completes, if it does."""
        self._pose = stamp_ns(message.header.stamp), from_pose(message.pose)
        return self.synchronised()

    def take_odometry(self, message: Odometry) -> Observation | None:
        """Take odometry; the observation it completes, if it does."""
        self._speeds = stamp_ns(message.header.stamp), speeds_of(message)
        return self.synchronised()

    def take_people(self, message: PointCloud2) -> Observation | None:
        """Take the people; the observation they complete, if they do."""
        if not self._needs_people:
            return None
        self._people = stamp_ns(message.header.stamp), from_people_message(message)
        return self.synchronised()

    def synchronised(self) -> Observation | None:
        """The observation whose three parts have one stamp, None when they differ."""
        if self._pose is None or self._speeds is None or self._pose[0] != self._speeds[0]:
            return None
        if self._needs_people and (self._people is None or self._people[0] != self._pose[0]):
            return None
        return self.latest()

    def latest(self) -> Observation | None:
        """The newest parts as one observation at the pose's time, None while one is missing."""
        if self._pose is None or self._speeds is None:
            return None
        if self._needs_people and self._people is None:
            return None
        people = NOBODY if self._people is None else self._people[1]
        time_s = self._pose[0] * 1e-9
        return make_observation(
            time_s=time_s,
            tick=round(time_s / self._control_period_s),
            pose=self._pose[1],
            speed_mps=self._speeds[1][0],
            yaw_rate_radps=self._speeds[1][1],
            people_position_m=people.position_m,
            people_velocity_mps=people.velocity_mps,
            people_id=people.identity,
        )
