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
from serd_ros.convert.sensors import from_people_message, to_people_message
from serd_ros.convert.stamp import Jump, StampClock
from serd_ros.endpoints import qos, topics
from serd_ros.process.serd_node import SerdNode
from sim.world.observation import Observation
from sim.world.observation_inbox import ObservationInbox


class ObservationPublisher:
    """Publishes an observation as people, odometry and robot pose, all with its stamp."""

    def __init__(self, node: Node) -> None:
        self._people = node.create_publisher(PointCloud2, topics.PEDESTRIANS, qos.STATE)
        self._odometry = node.create_publisher(Odometry, topics.ODOM, qos.STATE)
        self._pose = node.create_publisher(PoseStamped, topics.ROBOT_POSE, qos.STATE)

    def publish(self, observation: Observation, odometry_pose: PlanarPose) -> None:
        """Send the three messages; the pose last, since it is what people wait for."""
        self._people.publish(to_people_message(observation.people, observation.time_s))
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

    def on_pose(message: PoseStamped) -> None:
        pass_on(inbox.take_pose(*from_pose_stamped(message)))

    def on_odometry(message: Odometry) -> None:
        time_ns, _, speeds = from_odometry(message)
        pass_on(inbox.take_speeds(time_ns, speeds))

    def on_people(message: PointCloud2) -> None:
        if needs_people:
            pass_on(inbox.take_people(*from_people_message(message)))

    node.create_subscription(PoseStamped, topics.ROBOT_POSE, on_pose, qos.STATE)
    node.create_subscription(Odometry, topics.ODOM, on_odometry, qos.STATE)
    node.create_subscription(PointCloud2, topics.PEDESTRIANS, on_people, qos.STATE)
    return inbox
