"""Plain values of standard messages, deserialized by rosbags. Times in ns, lengths in m."""

import math
import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
from rosbags.typesys.store import Typestore

from serd_bag.errors import BagError
from serd_bag.formats.rosbag2.message_types import rosbags_types
from serd_bag.messages.clocks import FloatArray

_SECOND_NS = 1_000_000_000
#: Bytes before the content of a message; then seconds and nanoseconds of a stamp.
CDR_HEAD = 4
_STAMPS = (struct.Struct(">iI"), struct.Struct("<iI"))
_STAMP_END = CDR_HEAD + 8
_FRAME_LENGTH = struct.Struct("<I")
_POSE = struct.Struct("<7d")
#: NumPy kinds of the datatypes of a PointField.
_POINT_KINDS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}


@dataclass(frozen=True)
class Header:
    """A std_msgs/Header; stamp_ns: 0 where the sender set none."""

    stamp_ns: int
    frame: str


@dataclass(frozen=True)
class Transform:
    """Where a child frame is in that of the header: x, y, z in m, quaternion x, y, z, w."""

    header: Header
    child: str
    placed: tuple[float, ...]


@dataclass(frozen=True)
class Status:
    """One status of a DiagnosticArray."""

    name: str
    message: str
    values: dict[str, str]


def decode(data: bytes, type_name: str, store: Typestore | None = None) -> Any:
    """The message as an object of rosbags; store: None for the types of ROS 2 Jazzy.

    BagError where the bytes are no such message.
    """
    try:
        return (store or rosbags_types()).deserialize_cdr(data, type_name)
    except Exception as error:  # generated code raises errors of any kind for foreign bytes
        raise BagError(
            f"message must be a {type_name} in CDR, got {len(data)} bytes that are none"
            f" ({type(error).__name__}: {error}); look at what published it"
        ) from None


def message_stamp_ns(data: bytes, place: int = CDR_HEAD) -> int:
    """The stamp (ns) of a message with a header or a time at a place, by default its beginning."""
    if len(data) < place + 8:
        raise BagError(
            f"message must have a stamp ({place + 8} bytes), got {len(data)} bytes; drop it"
        )
    second, nanosecond = _STAMPS[data[1] & 1].unpack_from(data, place)
    return int(second * _SECOND_NS + nanosecond)


def pose_position(data: bytes) -> tuple[int, float, float]:
    """(stamp_ns, x_m, y_m) of a geometry_msgs/PoseStamped.

    Most messages of a recording are poses, and rosbags takes nine times as long for one.
    """
    stamp_ns = message_stamp_ns(data)
    try:
        if data[:2] == b"\0\1":
            (length,) = _FRAME_LENGTH.unpack_from(data, _STAMP_END)
            x, y, *_ = _POSE.unpack_from(data, 4 + (_STAMP_END + length + 7 & ~7))
            return stamp_ns, x, y
    except struct.error:
        pass  # rosbags finds what is wrong
    pose = decode(data, "geometry_msgs/msg/PoseStamped").pose.position
    return stamp_ns, pose.x, pose.y


def transforms(data: bytes, type_name: str, store: Typestore) -> tuple[Transform, ...]:
    """tf2_msgs/TFMessage, or tf/tfMessage of ROS 1."""
    found = []
    for each in decode(data, type_name, store).transforms:
        moved, turned = each.transform.translation, each.transform.rotation
        placed = (moved.x, moved.y, moved.z, turned.x, turned.y, turned.z, turned.w)
        found.append(Transform(header_of(each.header), each.child_frame_id, placed))
    return tuple(found)


def diagnostic_array(data: bytes) -> tuple[int, tuple[Status, ...]]:
    """(stamp_ns, statuses) of a diagnostic_msgs/DiagnosticArray."""
    message = decode(data, "diagnostic_msgs/msg/DiagnosticArray")
    statuses = (
        Status(each.name, each.message, {pair.key: pair.value for pair in each.values})
        for each in message.status
    )
    return header_of(message.header).stamp_ns, tuple(statuses)


def points_of(cloud: Any, names: tuple[str, ...]) -> dict[str, FloatArray]:
    """Named fields of a decoded sensor_msgs/PointCloud2, each (N,).

    BagError where one is missing or the sizes do not fit.
    """
    layout = {each.name: each for each in cloud.fields}
    for each in cloud.fields:
        if each.datatype not in _POINT_KINDS:
            raise BagError(
                f"point field {each.name} must have a datatype from 1 to 8, got {each.datatype}"
            )
    missing = [name for name in names if name not in layout]
    if missing:
        raise BagError(f"point cloud must have the field {missing[0]}, got {', '.join(layout)}")
    size = cloud.height * cloud.width * cloud.point_step
    if len(cloud.data) != size:
        raise BagError(f"point cloud must have {size} bytes of points, got {len(cloud.data)}")
    order = ">" if cloud.is_bigendian else "<"
    kinds = {
        "names": list(names),
        "formats": [order + _POINT_KINDS[layout[name].datatype] for name in names],
        "offsets": [layout[name].offset for name in names],
        "itemsize": cloud.point_step,
    }
    try:
        points: Any = np.frombuffer(cloud.data, dtype=np.dtype(kinds))  # type: ignore[call-overload]
    except ValueError as error:
        raise BagError(f"point cloud has fields that do not fit ({error})") from None
    with np.errstate(invalid="ignore"):  # a signalling NaN
        return {name: points[name].astype(np.float64) for name in names}


def header_of(header: Any) -> Header:
    """A decoded std_msgs/Header."""
    return Header(header.stamp.sec * _SECOND_NS + header.stamp.nanosec, header.frame_id)


def yaw_of_quaternion(x: float, y: float, z: float, w: float) -> float:
    """Heading of a rotation about any axis, seen from above."""
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
