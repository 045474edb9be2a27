"""How a node's quality of service is written into a bag."""

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from bags.qos import QosProfile


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
