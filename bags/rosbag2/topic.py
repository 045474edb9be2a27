"""A recorded topic."""

from dataclasses import dataclass

from bags.rosbag2.message_types import MessageType
from bags.rosbag2.qos import QosProfile


@dataclass(frozen=True)
class Topic:
    """name: with leading slash; qos: what its publishers offered."""

    name: str
    message_type: MessageType
    qos: tuple[QosProfile, ...] = ()
