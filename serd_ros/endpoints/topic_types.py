"""Message type and quality of service of every topic a bag may hold.

A topic of this stack goes by its name, any other as `topic:package/msg/Type`. rclpy takes a type
only with its compiled support. A message that travels as bytes needs no more of that than its name,
its hash and that its size is unbounded, so a support of this is made for types that are not
installed, for rmw_fastrtps_cpp alone. Its type description, which the middleware requires, has a
name and no fields.
"""

import ctypes
import importlib
import re
from dataclasses import dataclass
from functools import cache
from typing import Any

from rclpy.exceptions import InvalidTopicNameException
from rclpy.qos import QoSProfile
from rclpy.utilities import get_rmw_implementation_identifier
from rclpy.validate_topic_name import validate_topic_name
from rosbags.interfaces import Nodetype

from serd_bag.formats.rosbag2.message_types import message_type, typestore_of
from serd_bag.nearest import hint
from serd_bag.topic import MessageType
from serd_ros.convert import typed
from serd_ros.endpoints import qos, topics
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


typed.register()
#: How a type hash begins that is known.
HASH_START = "RIHS01_"
TF_TYPE = "tf2_msgs/msg/TFMessage"
_TWIST_STAMPED = "geometry_msgs/msg/TwistStamped"
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
        ("serd_msgs/msg/ArrivalForecast", qos.LATCHED, topics.ARRIVAL),
        ("serd_msgs/msg/Decision", qos.LATCHED, topics.DECISION),
        (typed.GUARD_STATE, qos.LATCHED, topics.GUARD_STATE),
        (typed.REPLAYED, qos.STATE, topics.REPLAYED),
        ("std_msgs/msg/String", qos.LATCHED, topics.MODEL, topics.ROBOT_DESCRIPTION),
        ("visualization_msgs/msg/MarkerArray", qos.LATCHED, topics.MARKERS_POLICY,
         topics.MARKERS_VALUE, topics.MARKERS_ARRIVAL),
        (TF_TYPE, None, topics.TF, topics.TF_STATIC),
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


_MIDDLEWARE = "rmw_fastrtps_cpp"
_SUPPORT = b"rosidl_typesupport_fastrtps_c"
_INTROSPECTION = b"rosidl_typesupport_introspection_c"
_HEADROOM = 1 << 16

_Handle = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_char_p)
_OfSupport = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p)
_MaximumSize = ctypes.CFUNCTYPE(ctypes.c_size_t, ctypes.POINTER(ctypes.c_char))


def _struct(**fields: Any) -> type[ctypes.Structure]:
    return type("_Struct", (ctypes.Structure,), {"_fields_": list(fields.items())})


_VOID, _TEXT, _SIZE = ctypes.c_void_p, ctypes.c_char_p, ctypes.c_size_t
#: message_type_support_callbacks_t; what converts messages stays empty.
_Callbacks = _struct(
    namespace=_TEXT, name=_TEXT, serialize=_VOID, deserialize=_VOID, size=_VOID,
    maximum_size=_MaximumSize, key=_VOID,
)  # fmt: skip
#: rosidl_typesupport_introspection_c__MessageMembers; none.
_Members = _struct(
    namespace=_TEXT, name=_TEXT, count=ctypes.c_uint32, size=_SIZE, has_key=ctypes.c_bool,
    members=_VOID, initialize=_VOID, finalize=_VOID,
)  # fmt: skip
#: rosidl_message_type_support_t.
_Support = _struct(
    identifier=_TEXT, data=_VOID, handle=_Handle, hash=_OfSupport, description=_OfSupport,
    sources=_OfSupport,
)  # fmt: skip
#: A rosidl sequence, or a string.
_Sequence = _struct(data=_TEXT, size=_SIZE, room=_SIZE)
#: rosidl_runtime_c__type_description__TypeDescription.
_Description = _struct(type_name=_Sequence, fields=_Sequence, others=_Sequence)
#: rosidl_type_hash_t; version 0 where the hash is not known.
_Hash = _struct(version=ctypes.c_uint8, value=ctypes.c_uint8 * 32)


@cache
def raw_message_class(kind: MessageType) -> Any | None:
    """A class that raw publishers and subscriptions take; None with another middleware."""
    if get_rmw_implementation_identifier() != _MIDDLEWARE:
        return None
    support, kept = _support(kind)
    members = {"_TYPE_SUPPORT": _capsule(ctypes.addressof(support)), "_kept": kept}
    unused = ("_CREATE_ROS_MESSAGE", "_CONVERT_FROM_PY", "_CONVERT_TO_PY", "_DESTROY_ROS_MESSAGE")
    metaclass = type("RawMetaclass", (type,), {**members, **dict.fromkeys(unused, _refuse)})
    return metaclass(kind.name.rpartition("/")[2], (), {"type_name": kind.name})


def _support(kind: MessageType) -> tuple[Any, tuple[Any, ...]]:
    """The support, and what it points to."""
    text = kind.name.encode()
    *namespace, name = text.split(b"/")
    callbacks = _Callbacks(b"::".join(namespace), name)
    callbacks.maximum_size = _MaximumSize(_unbounded)
    members = _Members(b"__".join(namespace), name)
    described = _Description(type_name=_Sequence(text, len(text), len(text) + 1))
    values = (_hash(kind.type_hash), described, _Sequence())
    supports, addresses = dict[bytes, Any](), dict[bytes, int]()
    handle = _Handle(lambda _, identifier: addresses.get(identifier))
    for identifier, data in ((_SUPPORT, callbacks), (_INTROSPECTION, members)):
        functions = (_returns(each) for each in values)
        supports[identifier] = _Support(identifier, ctypes.addressof(data), handle, *functions)
        addresses[identifier] = ctypes.addressof(supports[identifier])
    return supports[_SUPPORT], (supports, callbacks, members, values)


def _hash(text: str) -> Any:
    known = re.fullmatch(HASH_START + "([0-9a-f]{64})", text)
    return _Hash(1, (ctypes.c_uint8 * 32)(*bytes.fromhex(known[1]))) if known else _Hash()


def _returns(value: ctypes.Structure) -> Any:
    """A C function of the support that returns the address of the value."""
    address = ctypes.addressof(value)
    return _OfSupport(lambda _: address)


def _unbounded(bounds: Any) -> int:
    bounds[0] = b"\0"
    return _HEADROOM


def _refuse(*_: Any) -> None:
    raise NotImplementedError("messages of this type travel as bytes only; install its package")


def _capsule(address: int) -> Any:
    new = ctypes.pythonapi.PyCapsule_New
    new.restype = ctypes.py_object
    new.argtypes = (ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p)
    return new(address, None, None)
