"""Quality of service of a topic as bags keep it, and as a replay offers it."""

import importlib
from typing import Any

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from bags.rosbag2.qos import QosProfile
from serd_ros.endpoints.qos import STATE_DEPTH


def bag_qos(profile: QoSProfile) -> QosProfile:
    """The profile as bags keep it."""
    reliable = profile.reliability == ReliabilityPolicy.RELIABLE
    latched = profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
    # What other processes keep is not told through DDS.
    told = profile.history == HistoryPolicy.KEEP_LAST
    return QosProfile(
        reliability="reliable" if reliable else "best_effort",
        durability="transient_local" if latched else "volatile",
        history="keep_last" if told else "unknown",
        depth=int(profile.depth),
    )


def recording_qos(profile: QoSProfile) -> QoSProfile:
    """What a recorder asks for: as offered, but deep enough to lag behind for a while."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=max(profile.depth, STATE_DEPTH),
        reliability=profile.reliability,
        durability=profile.durability,
    )


def replay_qos(recorded: QosProfile) -> QoSProfile:
    """What a replay offers: as recorded, but deep enough for bursts of reliable messages."""
    reliable = recorded.reliability == "reliable"
    latched = recorded.durability == "transient_local"
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=recorded.depth if latched else max(recorded.depth, STATE_DEPTH),
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def message_class(type_name: str) -> Any | None:
    """The class of package/msg/Type, None where its package is not installed."""
    package, _, name = type_name.split("/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name, None)
    except ImportError:
        return None
