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
            package = self.name.partition("/")[0]
            raise NodeError(
                f"message type {self.name} must be one Python can import, got none; install"
                f" {package}, source a ROS installation that has it, or set"
                " RMW_IMPLEMENTATION=rmw_fastrtps_cpp"
            )
        return found

    @property
    def stamped(self) -> bool:
        """Whether the message begins with a time stamp."""
        fields = typestore_of(message_type(self.name)).fielddefs[self.name][1]
        return bool(fields) and fields[0][1] in [(Nodetype.NAME, kind) for kind in _TIMES]


_TWIST, _TWIST_STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"
_POSE, _BOOL = "geometry_msgs/msg/PoseStamped", "std_msgs/msg/Bool"
_DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
_TF = "tf2_msgs/msg/TFMessage"
_MARKERS = "visualization_msgs/msg/MarkerArray"
#: Of the topics of this stack.
TYPES = {
    topics.CLOCK: TopicType("rosgraph_msgs/msg/Clock", qos.CLOCK),
    topics.ODOM: TopicType("nav_msgs/msg/Odometry", qos.STATE),
    topics.ROBOT_POSE: TopicType(_POSE, qos.STATE),
    topics.SCAN: TopicType("sensor_msgs/msg/LaserScan", qos.STATE),
    topics.PEDESTRIANS: TopicType("sensor_msgs/msg/PointCloud2", qos.STATE),
    topics.JOY: TopicType("sensor_msgs/msg/Joy", qos.COMMAND),
    topics.CMD_VEL: TopicType(_TWIST, qos.STATE),
    topics.CMD_VEL_RAW: TopicType(_TWIST, qos.STATE),
    topics.CMD_VEL_TELEOP: TopicType(_TWIST, qos.COMMAND),
    topics.CMD_VEL_JOY: TopicType(_TWIST, qos.COMMAND),
    topics.DRIVER_GONE: TopicType(_BOOL, qos.COMMAND),
    topics.GUARD_OVERRIDE: TopicType(_BOOL, qos.COMMAND),
    topics.E_STOP: TopicType(_BOOL, qos.COMMAND),
    topics.E_STOP_ENGAGED: TopicType(_BOOL, qos.LATCHED),
    topics.MAP: TopicType("nav_msgs/msg/OccupancyGrid", qos.LATCHED),
    topics.INTENT: TopicType("geometry_msgs/msg/Vector3Stamped", qos.STATE),
    topics.WAYPOINT: TopicType(_POSE, qos.STATE),
    topics.EPISODE: TopicType(_DIAGNOSTICS, qos.STATE),
    topics.DIAGNOSTICS: TopicType(_DIAGNOSTICS, qos.STATE),
    topics.PLAN: TopicType("nav_msgs/msg/Path", qos.STATE),
    topics.GOAL_POSE: TopicType(_POSE, qos.COMMAND),
    topics.GOAL_AREA: TopicType("geometry_msgs/msg/PolygonStamped", qos.LATCHED),
    topics.ARRIVAL: TopicType("std_msgs/msg/Float64MultiArray", qos.LATCHED),
    topics.MODEL: TopicType("std_msgs/msg/String", qos.LATCHED),
    topics.MARKERS_PEOPLE: TopicType(_MARKERS, qos.STATE),
    topics.MARKERS_POLICY: TopicType(_MARKERS, qos.LATCHED),
    topics.MARKERS_VALUE: TopicType(_MARKERS, qos.LATCHED),
    topics.MARKERS_TRAPS: TopicType(_MARKERS, qos.LATCHED),
    topics.MARKERS_ARRIVAL: TopicType(_MARKERS, qos.LATCHED),
    topics.TF: TopicType(_TF),
    topics.TF_STATIC: TopicType(_TF),
    topics.ROBOT_DESCRIPTION: TopicType("std_msgs/msg/String", qos.LATCHED),
}


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
