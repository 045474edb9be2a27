"""Message type and quality of service of every topic a bag may hold.

A topic of this stack goes by its name, any other as `topic:package/msg/Type`.
"""

import importlib
import re
from dataclasses import dataclass
from typing import Any

from rclpy.exceptions import InvalidTopicNameException
from rclpy.qos import QoSProfile
from rclpy.validate_topic_name import validate_topic_name
from rosbags.interfaces import Nodetype

from serd_bag.formats.rosbag2.message_types import MessageType, message_type, typestore_of
from serd_bag.nearest import hint
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.raw_type import raw_message_class
from serd_ros.errors import NodeError

_TYPE_NAME = re.compile(r"\w+/\w+/\w+")
_TIMES = ("std_msgs/msg/Header", "builtin_interfaces/msg/Time")


@dataclass(frozen=True)
class TopicType:
    """name: package/msg/Type; qos: what to subscribe with, None for what its publishers offer."""

    name: str
    qos: QoSProfile | None = None

    @property
    def message(self) -> Any:
        """The message class, for raw messages alone where the package is not installed."""
        found = message_class(message_type(self.name))
        if found is None:
            raise NodeError(
                f"message type {self.name} must be one Python can import, got none; install"
                f" {self.name.partition('/')[0]}, source a ROS installation that has it, or set"
                " RMW_IMPLEMENTATION=rmw_fastrtps_cpp"
            )
        return found

    @property
    def stamped(self) -> bool:
        """Whether the message begins with a time stamp."""
        fields = typestore_of(message_type(self.name)).fielddefs[self.name][1]
        return bool(fields) and fields[0][1] in [(Nodetype.NAME, kind) for kind in _TIMES]


_TWIST_STAMPED, _TF = "geometry_msgs/msg/TwistStamped", "tf2_msgs/msg/TFMessage"
#: Of the topics of this stack.
TYPES = {
    topic: TopicType(name, profile)
    for name, profile, *names in (
        ("rosgraph_msgs/msg/Clock", qos.CLOCK, topics.CLOCK),
        ("nav_msgs/msg/Odometry", qos.STATE, topics.ODOM),
        ("geometry_msgs/msg/PoseStamped", qos.STATE, topics.ROBOT_POSE, topics.WAYPOINT),
        ("geometry_msgs/msg/PoseStamped", qos.COMMAND, topics.GOAL_POSE),
        ("sensor_msgs/msg/LaserScan", qos.STATE, topics.SCAN),
        ("sensor_msgs/msg/PointCloud2", qos.STATE, topics.PEDESTRIANS),
        ("sensor_msgs/msg/Joy", qos.COMMAND, topics.JOY),
        ("geometry_msgs/msg/Twist", qos.STATE, topics.CMD_VEL, topics.CMD_VEL_RAW),
        ("geometry_msgs/msg/Twist", qos.COMMAND, topics.CMD_VEL_TELEOP, topics.CMD_VEL_JOY),
        ("std_msgs/msg/Bool", qos.COMMAND, topics.DRIVER_GONE, topics.GUARD_OVERRIDE),
        ("std_msgs/msg/Bool", qos.COMMAND, topics.E_STOP),
        ("std_msgs/msg/Bool", qos.LATCHED, topics.E_STOP_ENGAGED),
        ("nav_msgs/msg/OccupancyGrid", qos.LATCHED, topics.MAP),
        ("geometry_msgs/msg/Vector3Stamped", qos.STATE, topics.INTENT),
        ("diagnostic_msgs/msg/DiagnosticArray", qos.STATE, topics.EPISODE, topics.DIAGNOSTICS),
        ("nav_msgs/msg/Path", qos.STATE, topics.PLAN),
        ("geometry_msgs/msg/PolygonStamped", qos.LATCHED, topics.GOAL_AREA),
        ("std_msgs/msg/Float64MultiArray", qos.LATCHED, topics.ARRIVAL),
        ("std_msgs/msg/String", qos.LATCHED, topics.MODEL, topics.ROBOT_DESCRIPTION),
        ("visualization_msgs/msg/MarkerArray", qos.STATE, topics.MARKERS_PEOPLE),
        ("visualization_msgs/msg/MarkerArray", qos.LATCHED, topics.MARKERS_POLICY,
         topics.MARKERS_VALUE, topics.MARKERS_TRAPS, topics.MARKERS_ARRIVAL),
        (_TF, None, topics.TF, topics.TF_STATIC),
    )
    for topic in names
}  # fmt: skip


def topic_type(topic: str, *, stamped_cmd_vel: bool) -> TopicType:
    """What travels on a topic of ours; NodeError with the nearest name for any other."""
    if topic in (topics.CMD_VEL, topics.CMD_VEL_RAW) and stamped_cmd_vel:
        return TopicType(_TWIST_STAMPED, qos.STATE)
    if topic not in TYPES:
        raise NodeError(
            f"topics must be topics of this stack, or written topic:package/msg/Type,"
            f" got {topic!r}; {hint(topic, TYPES)}"
        )
    return TYPES[topic]


def named_topic(text: str, *, stamped_cmd_vel: bool) -> tuple[str, TopicType]:
    """Name and type of `topic`, one of ours, or of `topic:package/msg/Type`, any that is installed;
    an error names what is wrong."""
    topic, separator, type_name = text.partition(":")
    if not separator:
        return topic, topic_type(topic, stamped_cmd_vel=stamped_cmd_vel)
    try:
        validate_topic_name(topic)
    except InvalidTopicNameException as error:
        reason = str(error).splitlines()[0].rstrip(".:")
        raise NodeError(f"topics: {topic!r} must be a topic name, {reason}; correct it") from None
    return topic, TopicType(type_name)


def message_class(kind: MessageType) -> Any | None:
    """The installed class of a type, else one for raw messages; None where there can be neither."""
    package, _, name = kind.name.partition("/msg/")
    if not _TYPE_NAME.fullmatch(kind.name):
        return None
    try:
        installed = getattr(importlib.import_module(f"{package}.msg"), name, None)
    except ImportError:
        installed = None
    return installed or raw_message_class(kind)
