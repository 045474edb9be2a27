"""Message type and quality of service of every topic a bag may hold."""

from dataclasses import dataclass
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PolygonStamped, PoseStamped, Twist, TwistStamped, Vector3Stamped
from nav_msgs.msg import OccupancyGrid, Odometry, Path
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Joy, LaserScan, PointCloud2
from std_msgs.msg import Float64MultiArray

from serd_ros import qos, topics
from serd_ros.errors import NodeError
from storage.nearest import hint


@dataclass(frozen=True)
class TopicType:
    """Message class, what to subscribe with, and whether its first field is a time stamp."""

    message: Any
    qos: QoSProfile
    stamped: bool = True

    @property
    def name(self) -> str:
        """package/msg/Type, as bags name it."""
        package = self.message.__module__.split(".", 1)[0]
        return f"{package}/msg/{self.message.__name__}"


_TYPES = {
    topics.CLOCK: TopicType(Clock, qos.CLOCK),
    topics.ODOM: TopicType(Odometry, qos.STATE),
    topics.ROBOT_POSE: TopicType(PoseStamped, qos.STATE),
    topics.SCAN: TopicType(LaserScan, qos.STATE),
    topics.PEDESTRIANS: TopicType(PointCloud2, qos.STATE),
    topics.JOY: TopicType(Joy, qos.COMMAND),
    topics.CMD_VEL_TELEOP: TopicType(Twist, qos.COMMAND, stamped=False),
    topics.CMD_VEL_JOY: TopicType(Twist, qos.COMMAND, stamped=False),
    topics.MAP: TopicType(OccupancyGrid, qos.LATCHED),
    topics.INTENT: TopicType(Vector3Stamped, qos.STATE),
    topics.WAYPOINT: TopicType(PoseStamped, qos.STATE),
    topics.EPISODE: TopicType(DiagnosticArray, qos.STATE),
    topics.DIAGNOSTICS: TopicType(DiagnosticArray, qos.STATE),
    topics.PLAN: TopicType(Path, qos.STATE),
    topics.GOAL_POSE: TopicType(PoseStamped, qos.COMMAND),
    topics.GOAL_AREA: TopicType(PolygonStamped, qos.LATCHED),
    topics.ARRIVAL: TopicType(Float64MultiArray, qos.LATCHED, stamped=False),
}


def topic_type(topic: str, *, stamped_cmd_vel: bool) -> TopicType:
    """What travels on a topic of ours; NodeError with the nearest name for any other."""
    if topic == topics.CMD_VEL:
        if stamped_cmd_vel:
            return TopicType(TwistStamped, qos.STATE)
        return TopicType(Twist, qos.STATE, stamped=False)
    if topic not in _TYPES:
        raise NodeError(
            f"topics must be topics of this stack, got {topic!r}; "
            f"{hint(topic, [*_TYPES, topics.CMD_VEL])}"
        )
    return _TYPES[topic]
