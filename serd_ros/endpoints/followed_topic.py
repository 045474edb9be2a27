"""Subscriptions with the times of each message, and with the quality of service of publishers.

A node that was stopped finds the commands that waited for it. By the time of their arrival they
would be new, so the time counts at which the middleware sent them, and only the newest one waits.

A subscription matches a publisher when it requests no more than is offered: reliability, and
messages from before it was made (transient local). So it requests what all publishers offer, and
where only some publishers are latched, a second subscription receives the others.
"""

import inspect
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from geometry_msgs.msg import Twist, TwistStamped
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.subscription import Subscription

from serd_ros.endpoints import qos
from serd_ros.endpoints.qos import common_qos, less_demanding, recording_qos, requests_too_much
from serd_ros.endpoints.topic_types import TopicType
from serd_ros.errors import MessageError

#: Messages of a latched publisher that are compared, which two subscriptions receive.
_COMPARED = 100
#: Clocks of machines may differ by this much.
_CLOCKS_AGREE_S = 0.2


@dataclass(frozen=True)
class Received:
    """A raw message; received_ns, sent_ns: by the clocks of this machine and the publisher's,
    sent_ns 0 where the middleware does not state it. number: from 1 on, of the publisher's
    messages, likewise."""

    topic: str
    data: bytes
    received_ns: int
    sent_ns: int
    number: int = 0


class FollowedTopic:
    """Subscribes at once where the type has a profile, else as soon as there is a publisher.

    name: in full; take: called with each message, does not raise for a bad one; offered: by the
    publishers there were when it subscribed.
    """

    def __init__(
        self, node: Node, name: str, kind: TopicType, take: Callable[[Received], None]
    ) -> None:
        self.name, self.kind, self.stamped = name, kind, kind.stamped
        self.offered: tuple[QoSProfile, ...] = ()
        self._others: list[str] = []
        self._node, self._take = node, take
        #: The last one follows the publishers; one before it is latched.
        self._subscriptions: list[Subscription] = []
        self._taken: deque[tuple[int, bytes]] = deque(maxlen=_COMPARED)
        if kind.qos is not None:
            self.offered = (kind.qos,)
            self._subscriptions = [self._subscribe(recording_qos(kind.qos))]

    @property
    def is_subscribed(self) -> bool:
        """Whether there is a subscription."""
        return bool(self._subscriptions)

    def look(self) -> bool:
        """Follow the publishers; whether it subscribed just now."""
        found = self._node.get_publishers_info_by_topic(self.name)
        offered = [each.qos_profile for each in found if each.topic_type == self.kind.name]
        self._others = [] if offered else sorted({each.topic_type for each in found})
        if not offered:
            return False
        is_new = not self._subscriptions
        if is_new:
            self.offered = tuple(offered)
            latched = [each for each in offered if _is_latched(each)]
            self._subscriptions = [self._subscribe(common_qos(latched or offered))]
        self._subscriptions[-1:] = matching_subscriptions(
            self._node,
            self._subscriptions[-1],
            offered,
            self._subscribe,
            lambda data, info: self.take(self._received(data, info)),
        )
        return is_new

    def take(self, message: Received) -> None:
        """Take a message, once where two subscriptions received it."""
        if len(self._subscriptions) > 1 and message.sent_ns:
            key = message.sent_ns, message.data
            if key in self._taken:
                return
            self._taken.append(key)
        self._take(message)

    def close(self) -> None:
        """End the subscriptions."""
        while self._subscriptions:
            self._node.destroy_subscription(self._subscriptions.pop())

    @property
    def silence(self) -> str:
        """Why no message can arrive, as far as is known, else empty."""
        if self._others:
            return f"{self.name} is {', '.join(self._others)}, not {self.kind.name}"
        return "" if self.is_subscribed else f"{self.name} has no publisher"

    def waiting(self) -> Iterator[Received]:
        """Messages that were received and not taken yet."""
        return (
            self._received(data, info)
            for subscription in self._subscriptions
            for data, info in waiting_messages(subscription)
        )

    def _received(self, data: bytes, info: Mapping[str, int]) -> Received:
        received_ns = info["received_timestamp"]
        if received_ns <= 0:
            received_ns = time.time_ns()
        number = info.get("publication_sequence_number") or 0
        return Received(self.name, data, received_ns, info["source_timestamp"], number)

    def _subscribe(self, profile: QoSProfile) -> Subscription:
        callback = _with_info(lambda data, info: self.take(self._received(data, info)))
        return self._node.create_subscription(
            self.kind.message, self.name, callback, profile, raw=True
        )


def matching_subscriptions(
    node: Node,
    subscription: Subscription,
    offered: Sequence[QoSProfile],
    make: Callable[[QoSProfile], Subscription],
    take: Callable[[Any, Mapping[str, int]], None],
) -> list[Subscription]:
    """The subscription, or what matches all publishers in its place, the one to follow last.

    A latched one stays where some publishers are volatile, with a volatile one beside it; any other
    is replaced. take: called with each message that waits in it then, and its info.
    """
    common = common_qos(offered)
    if not offered or not requests_too_much(subscription.qos_profile, common):
        return [subscription]
    profile = less_demanding(subscription.qos_profile, common)
    stays = _is_latched(subscription.qos_profile) and any(map(_is_latched, offered))
    if stays and not _is_latched(profile):
        return [subscription, make(profile)]
    for message, info in waiting_messages(subscription):
        take(message, info)
    node.destroy_subscription(subscription)
    return [make(profile)]


def waiting_messages(subscription: Subscription) -> Iterator[tuple[Any, Mapping[str, int]]]:
    """The messages that wait, with their info; works until the node is destroyed, also after a
    signal."""
    raw = bool(subscription.raw)
    while (found := subscription.handle.take_message(subscription.msg_type, raw)) is not None:
        yield bytes(found[0]) if raw else found[0], found[1]


def _is_latched(profile: QoSProfile) -> bool:
    return bool(profile.durability == DurabilityPolicy.TRANSIENT_LOCAL)


def follow_commands(
    node: Node,
    kind: type[Twist | TwistStamped],
    topic: str,
    take: Callable[[Any, float], None],
) -> None:
    """Call back with each command and its age (s) by the clocks of its publisher and this machine.

    The age is 0 where the middleware does not state when a message was sent. A command that was
    sent in the future is dropped with a MessageError, since its age is unknown.
    """

    def take_sent(message: Any, info: Mapping[str, int]) -> None:
        sent_ns = info["source_timestamp"]
        age_s = (time.time_ns() - sent_ns) * 1e-9 if sent_ns > 0 else 0.0
        if age_s < -_CLOCKS_AGREE_S:
            raise MessageError(
                f"commands must be sent at most {_CLOCKS_AGREE_S:g} s in the future",
                f"{-age_s:.1f} s",
                "set the clocks of the machines",
            )
        take(message, max(age_s, 0.0))

    node.create_subscription(kind, topic, _with_info(take_sent), qos.NEWEST)


def _with_info(take: Callable[[Any, Mapping[str, int]], None]) -> Callable[..., None]:
    """A callback by which rclpy delivers message and info."""

    def callback(*arguments: Any) -> None:
        """EventsExecutor passes message and info as one tuple, other executors as two."""
        take(*(arguments if len(arguments) == 2 else arguments[0]))

    # rclpy delivers the info where the signature has two parameters.
    callback.__signature__ = inspect.signature(take)  # type: ignore[attr-defined]
    return callback
