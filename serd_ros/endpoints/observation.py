"""The three topics of an observation: published together, and put together again by stamp."""

from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from sensor_msgs.msg import PointCloud2

from serd_ros.convert.pose import (
    PlanarPose,
    from_odometry,
    from_pose_stamped,
    to_odometry,
    to_pose_stamped,
)
from serd_ros.convert.sensors import (
    NOBODY,
    People,
    from_people_message,
    people_of,
    to_people_message,
)
from serd_ros.convert.stamp import Jump, StampClock
from serd_ros.endpoints import qos, topics
from serd_ros.process.serd_node import SerdNode
from sim.world.observation import Observation, make_observation


class ObservationInbox:
    """Keeps the newest pose, odometry and people.

    The simulator stamps the three alike; `synchronised` gives an observation once per stamp, when
    all three parts of it are there. `latest` mixes stamps, for robots whose sensors run apart.
    needs_people: when False, observations have no people and wait for pose and odometry only.
    """

    def __init__(self, control_period_s: float, *, needs_people: bool = True) -> None:
        self._needs_people = needs_people
        self._control_period_s = control_period_s
        self._pose: tuple[int, PlanarPose] | None = None
        self._speeds: tuple[int, tuple[float, float]] | None = None
        self._people: tuple[int, People] | None = None

    def take_pose(self, message: PoseStamped) -> Observation | None:
        """Take a pose; the observation it completes, if it does."""
        self._pose = from_pose_stamped(message)
        return self.synchronised()

    def take_odometry(self, message: Odometry) -> Observation | None:
        """Take odometry; the observation it completes, if it does."""
        time_ns, _, speeds = from_odometry(message)
        self._speeds = time_ns, speeds
        return self.synchronised()

    def take_people(self, message: PointCloud2) -> Observation | None:
        """Take the people; the observation they complete, if they do."""
        if not self._needs_people:
            return None
        self._people = from_people_message(message)
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


class ObservationPublisher:
    """Publishes an observation as people, odometry and robot pose, all with its stamp."""

    def __init__(self, node: Node) -> None:
        self._people = node.create_publisher(PointCloud2, topics.PEDESTRIANS, qos.STATE)
        self._odometry = node.create_publisher(Odometry, topics.ODOM, qos.STATE)
        self._pose = node.create_publisher(PoseStamped, topics.ROBOT_POSE, qos.STATE)

    def publish(self, observation: Observation, odometry_pose: PlanarPose) -> None:
        """Send the three messages; the pose last, since it is what people wait for."""
        self._people.publish(to_people_message(people_of(observation), observation.time_s))
        self._odometry.publish(to_odometry(observation, odometry_pose))
        self._pose.publish(to_pose_stamped(observation.pose, observation.time_s))


def subscribe_observations(
    node: SerdNode[Any],
    control_period_s: float,
    callback: Callable[[Observation], None],
    *,
    needs_people: bool = True,
) -> ObservationInbox:
    """Call back with every observation whose parts have arrived; the inbox is returned.

    `node.clock_jumped` is called before an observation after a jump; late ones are left out.
    needs_people: False for who finds people without `pedestrians`, which need not exist then.
    """
    inbox = ObservationInbox(control_period_s, needs_people=needs_people)
    clock = StampClock()

    def pass_on(observation: Observation | None) -> None:
        if observation is None:
            return
        jump = clock.advance(round(observation.time_s * 1e9))
        if jump is Jump.LATE:
            return
        if jump is not Jump.NONE:
            node.clock_jumped(jump)
        callback(observation)

    node.create_subscription(
        PoseStamped, topics.ROBOT_POSE, lambda m: pass_on(inbox.take_pose(m)), qos.STATE
    )
    node.create_subscription(
        Odometry, topics.ODOM, lambda m: pass_on(inbox.take_odometry(m)), qos.STATE
    )
    node.create_subscription(
        PointCloud2, topics.PEDESTRIANS, lambda m: pass_on(inbox.take_people(m)), qos.STATE
    )
    return inbox
