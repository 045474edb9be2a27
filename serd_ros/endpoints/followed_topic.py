"""Raw subscriptions with the times of each message, and with the quality of service of publishers.

A subscription matches a publisher when it requests no more than is offered: reliability, and
messages from before it was made (transient local). So it requests what all publishers offer, and
where only some publishers are latched, a second subscription receives the others.
"""

import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from serd_ros.endpoints.endpoints import Endpoints, waiting_messages
from serd_ros.endpoints.qos import common_qos, is_latched, recording_qos
from serd_ros.endpoints.topic_types import TopicType

#: Messages of a latched publisher that are compared, which two subscriptions receive.
_COMPARED = 100


@dataclass(frozen=True)
class Received:
    """A raw message; received_ns, sent_ns: by the clocks of this machine and the publisher's.

    number: from 1 on, of the publisher's messages; it and sent_ns are 0 where not stated.
    """

    topic: str
    data: bytes
    received_ns: int
    sent_ns: int
    number: int = 0


class FollowedTopic:
    """Subscribes at once where the type has a profile, else as soon as there is a publisher.

    name: in full; take: called with each message; topic: by which bad ones are counted, the name
    when empty; offered: by the publishers there were when it subscribed.
    """

    def __init__(
        self,
        endpoints: Endpoints,
        name: str,
        kind: TopicType,
        take: Callable[[Received], None],
        topic: str = "",
    ) -> None:
        self.name, self.kind, self.stamped = name, kind, kind.stamped
        self.offered: tuple[QoSProfile, ...] = ()
        self._others: list[str] = []
        self._endpoints, self._take = endpoints, endpoints.guarded(topic or name, take)
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
        found = self._endpoints.node.get_publishers_info_by_topic(self.name)
        offered = [each.qos_profile for each in found if each.topic_type == self.kind.name]
        self._others = [] if offered else sorted({each.topic_type for each in found})
        if not offered:
            return False
        is_new = not self._subscriptions
        if is_new:
            self.offered = tuple(offered)
            latched = [each for each in offered if is_latched(each)]
            self._subscriptions = [self._subscribe(common_qos(latched or offered))]
        self._subscriptions[-1:] = self._endpoints.matching(
            self._subscriptions[-1], offered, self._subscribe, self._take_received
        )
        return is_new

    def take(self, message: Received) -> None:
        """Take a message, once where two subscriptions received it."""
        key = message.sent_ns, message.data
        if len(self._subscriptions) > 1 and message.sent_ns:
            if key in self._taken:
                return
            self._taken.append(key)
        self._take(message)

    def close(self) -> None:
        """End the subscriptions."""
        while self._subscriptions:
            self._endpoints.destroy(self._subscriptions.pop())

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

    def _take_received(self, data: bytes, info: Mapping[str, int]) -> None:
        self.take(self._received(data, info))

    def _received(self, data: bytes, info: Mapping[str, int]) -> Received:
        received_ns = max(info["received_timestamp"], 0) or time.time_ns()
        number = info.get("publication_sequence_number") or 0
        return Received(self.name, data, received_ns, info["source_timestamp"], number)

    def _subscribe(self, profile: QoSProfile) -> Subscription:
        return self._endpoints.subscribe_raw(
            self.kind.message, self.name, self._take_received, profile
        )
