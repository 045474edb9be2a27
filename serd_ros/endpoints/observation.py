"""The three topics an observation travels on, published and subscribed alike everywhere."""

from collections.abc import Callable

from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from sensor_msgs.msg import PointCloud2

from serd_ros.convert.frames import Pose
from serd_ros.convert.odometry import to_odometry
from serd_ros.convert.people import people_of, to_people_message
from serd_ros.convert.pose import to_pose_stamped
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.inbox import ObservationInbox
from sim.world.observation import Observation


class ObservationPublisher:
    """Publishes an observation as people, odometry and robot pose, all with its stamp."""

    def __init__(self, node: Node) -> None:
        self._people = node.create_publisher(PointCloud2, topics.PEDESTRIANS, qos.STATE)
        self._odometry = node.create_publisher(Odometry, topics.ODOM, qos.STATE)
        self._pose = node.create_publisher(PoseStamped, topics.ROBOT_POSE, qos.STATE)

    def publish(self, observation: Observation, odometry_pose: Pose) -> None:
        """Send the three messages; the pose last, since it is what people wait for."""
        self._people.publish(to_people_message(people_of(observation), observation.time_s))
        self._odometry.publish(to_odometry(observation, odometry_pose))
        self._pose.publish(to_pose_stamped(observation.pose, observation.time_s))


def subscribe_observations(
    node: Node,
    control_period_s: float,
    callback: Callable[[Observation], None],
    *,
    needs_people: bool = True,
) -> ObservationInbox:
    """Call back with every observation whose parts have arrived; the inbox is returned.

    needs_people: False for who finds people without `pedestrians`, which nobody need publish then.
    """
    inbox = ObservationInbox(control_period_s, needs_people=needs_people)

    def pass_on(observation: Observation | None) -> None:
        if observation is not None:
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
