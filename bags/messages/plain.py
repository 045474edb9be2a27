"""What the stack needs of standard messages, as plain values. Times in ns, lengths in m."""

import math
import struct
from dataclasses import dataclass

from bags.messages.cdr import CdrCursor

_STAMP_AND_LENGTH = struct.Struct("<iII")
_POSE = struct.Struct("<7d")
_SECOND_NS = 1_000_000_000


@dataclass(frozen=True)
class Header:
    """stamp_ns: 0 where the sender set none."""

    stamp_ns: int
    frame: str


@dataclass(frozen=True)
class PlanarPose:
    """Position and heading in the plane of the frame."""

    header: Header
    x_m: float
    y_m: float
    yaw_rad: float


@dataclass(frozen=True)
class PlanarVector:
    """A vector in the plane of the frame."""

    header: Header
    x: float
    y: float


@dataclass(frozen=True)
class Status:
    """One status of a DiagnosticArray."""

    name: str
    message: str
    values: dict[str, str]


@dataclass(frozen=True)
class DiagnosticReport:
    """A whole DiagnosticArray."""

    header: Header
    statuses: tuple[Status, ...]


def read_header(cursor: CdrCursor) -> Header:
    """std_msgs/Header."""
    second, nanosecond = int(cursor.number("i")), int(cursor.number("I"))
    return Header(second * _SECOND_NS + nanosecond, cursor.text())


def read_planar_pose(cursor: CdrCursor, header: Header) -> PlanarPose:
    """geometry_msgs/Pose after its header."""
    x, y, _, *quaternion = cursor.numbers("d", 7)
    return PlanarPose(header, x, y, yaw_of_quaternion(*quaternion))


def pose_stamped(data: bytes) -> PlanarPose:
    """geometry_msgs/PoseStamped; PoseWithCovarianceStamped begins with the same fields."""
    cursor = CdrCursor(data)
    return read_planar_pose(cursor, read_header(cursor))


def vector3_stamped(data: bytes) -> PlanarVector:
    """geometry_msgs/Vector3Stamped."""
    cursor = CdrCursor(data)
    header = read_header(cursor)
    x, y, _ = cursor.numbers("d", 3)
    return PlanarVector(header, x, y)


def diagnostic_array(data: bytes) -> DiagnosticReport:
    """diagnostic_msgs/DiagnosticArray."""
    cursor = CdrCursor(data)
    header = read_header(cursor)
    return DiagnosticReport(header, tuple(_status(cursor) for _ in range(cursor.length())))


def pose_position(data: bytes) -> tuple[int, float, float]:
    """(stamp_ns, x_m, y_m) of a PoseStamped: the fast way for the topic of which there is most."""
    try:
        if data[1] == 1:
            second, nanosecond, length = _STAMP_AND_LENGTH.unpack_from(data, 4)
            offset = 4 + (12 + length + 7 & ~7)
            x, y, _, _, _, _, _ = _POSE.unpack_from(data, offset)
            return second * _SECOND_NS + nanosecond, x, y
    except (struct.error, IndexError):
        pass  # the careful way says what is wrong
    pose = pose_stamped(data)
    return pose.header.stamp_ns, pose.x_m, pose.y_m


def yaw_of_quaternion(x: float, y: float, z: float, w: float) -> float:
    """Heading of a rotation about any axis, seen from above."""
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def _status(cursor: CdrCursor) -> Status:
    cursor.raw(1)
    name, message, _ = cursor.text(), cursor.text(), cursor.text()
    pairs = ((cursor.text(), cursor.text()) for _ in range(cursor.length()))
    return Status(name, message, dict(pairs))


@dataclass(frozen=True)
class PlanarTransform:
    """Where a child frame is in its parent frame."""

    pose: PlanarPose
    child: str


def odometry(data: bytes) -> PlanarPose:
    """nav_msgs/Odometry: its pose."""
    cursor = CdrCursor(data)
    header = read_header(cursor)
    cursor.text()
    return read_planar_pose(cursor, header)


def twist(data: bytes) -> tuple[float, float]:
    """geometry_msgs/Twist: linear (x, y) in the robot's frame, m/s."""
    x, y, _ = CdrCursor(data).numbers("d", 3)
    return x, y


def transforms(data: bytes) -> tuple[PlanarTransform, ...]:
    """tf2_msgs/TFMessage."""
    cursor = CdrCursor(data)
    return tuple(_transform(cursor) for _ in range(cursor.length()))


def _transform(cursor: CdrCursor) -> PlanarTransform:
    header, child = read_header(cursor), cursor.text()
    return PlanarTransform(read_planar_pose(cursor, header), child)
