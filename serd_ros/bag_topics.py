"""How a node's quality of service is written into a bag, and when a raw message was made."""

from typing import Literal

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from bags.qos import QosProfile

_CDR_HEADER = 4
_NS = 1_000_000_000


def bag_qos(profile: QoSProfile) -> QosProfile:
    """The profile as bags keep it."""
    reliable = profile.reliability == ReliabilityPolicy.RELIABLE
    latched = profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
    return QosProfile(
        reliability="reliable" if reliable else "best_effort",
        durability="transient_local" if latched else "volatile",
        history="keep_last",
        depth=int(profile.depth),
    )


def cdr_stamp_ns(data: bytes) -> int:
    """The stamp (ns) a raw message begins with: sec (int32), nanosec (uint32) after the header."""
    order: Literal["little", "big"] = "little" if data[1] & 1 else "big"
    seconds = int.from_bytes(data[_CDR_HEADER : _CDR_HEADER + 4], order, signed=True)
    nanoseconds = int.from_bytes(data[_CDR_HEADER + 4 : _CDR_HEADER + 8], order)
    return seconds * _NS + nanoseconds
