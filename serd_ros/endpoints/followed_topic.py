"""A raw subscription with the quality of service that the publishers of its topic offer.

A subscription matches a publisher when it requests no more than is offered: reliability, and
messages from before it was made (transient local). So it requests what all publishers offer.
"""

import inspect
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from serd_ros.endpoints.qos import STATE_DEPTH, recording_qos
from serd_ros.endpoints.topic_types import TopicType

_RELIABLE = ReliabilityPolicy.RELIABLE
_LATCHED = DurabilityPolicy.TRANSIENT_LOCAL


@dataclass(frozen=True)
class Received:
    """A raw message; received_ns, sent_ns: by the clocks of this machine and the publisher's,
    sent_ns 0 where the middleware does not state it."""

    topic: str
    data: bytes
    received_ns: int
    sent_ns: int


def common_qos(offered: Iterable[QoSProfile]) -> QoSProfile:
    """The strictest profile that matches every one of the publishers."""
    profiles = tuple(offered)
    reliable = all(each.reliability == _RELIABLE for each in profiles)
    latched = all(each.durability == _LATCHED for each in profiles)
    return QoSProfile(
        depth=STATE_DEPTH,
        reliability=_RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=_LATCHED if latched else DurabilityPolicy.VOLATILE,
    )


def requests_too_much(requested: QoSProfile, offered: QoSProfile) -> bool:
    """Whether a reader with the first profile does not match a publisher with the second."""
    resends = requested.reliability == _RELIABLE and offered.reliability != _RELIABLE
    return resends or (requested.durability == _LATCHED and offered.durability != _LATCHED)


class FollowedTopic:
    """Subscribes at once where the type says how, else as soon as there is a publisher.

    name: in full; take: called with each message, does not raise for a bad one; offered: by the
    publishers there were when it subscribed.
    """

    def __init__(
        self, node: Node, name: str, kind: TopicType, take: Callable[[Received], None]
    ) -> None:
        self.name, self.kind, self.stamped = name, kind, kind.stamped
        self.offered: tuple[QoSProfile, ...] = ()
        self._others: list[str] = []
        self._node, self.take = node, take
        self._subscription: Subscription | None = None
        if kind.qos is not None:
            self.offered = (kind.qos,)
            self._subscribe(recording_qos(kind.qos))

    @property
    def is_subscribed(self) -> bool:
        """Whether there is a subscription."""
        return self._subscription is not None

    def look(self) -> bool:
        """Follow the publishers; whether it subscribed just now."""
        found = self._node.get_publishers_info_by_topic(self.name)
        offered = [each.qos_profile for each in found if each.topic_type == self.kind.name]
        self._others = [] if offered else sorted({each.topic_type for each in found})
        if not offered:
            return False
        if self._subscription is None:
            self.offered = tuple(offered)
            self._subscribe(common_qos(offered))
            return True
        self._request_less(self._subscription, common_qos(offered))
        return False

    @property
    def silence(self) -> str:
        """Why no message can arrive, as far as is known, else empty."""
        if self._others:
            return f"{self.name} is {', '.join(self._others)}, not {self.kind.name}"
        return "" if self.is_subscribed else f"{self.name} has no publisher"

    def _request_less(self, subscription: Subscription, offered: QoSProfile) -> None:
        if requests_too_much(subscription.qos_profile, offered):
            for message in self.waiting():
                self.take(message)
            self._node.destroy_subscription(subscription)
            self._subscribe(offered)

    def waiting(self) -> Iterator[Received]:
        """Messages that were received and not taken yet."""
        found = iter(()) if self._subscription is None else waiting_messages(self._subscription)
        return (self._received(data, info) for data, info in found)

    def _received(self, data: bytes, info: Mapping[str, int]) -> Received:
        received_ns = info["received_timestamp"]
        if received_ns <= 0:
            received_ns = time.time_ns()
        return Received(self.name, data, received_ns, info["source_timestamp"])

    def _subscribe(self, profile: QoSProfile) -> None:
        def callback(*arguments: Any) -> None:
            """EventsExecutor passes message and info as one tuple, other executors as two."""
            data, info = arguments if len(arguments) == 2 else arguments[0]
            self.take(self._received(data, info))

        # rclpy delivers the info where the signature has two parameters.
        callback.__signature__ = inspect.signature(self._received)  # type: ignore[attr-defined]
        self._subscription = self._node.create_subscription(
            self.kind.message, self.name, callback, profile, raw=True
        )


def waiting_messages(subscription: Subscription) -> Iterator[tuple[bytes, Mapping[str, int]]]:
    """The raw messages that wait, with their info; works until the node is destroyed, also after a
    signal."""
    while (found := subscription.handle.take_message(subscription.msg_type, True)) is not None:
        yield bytes(found[0]), found[1]
