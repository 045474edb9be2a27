"""One publisher for each recorded topic; raw messages go out as they were recorded."""

from collections import Counter
from collections.abc import Collection, Iterable

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import ReliabilityPolicy

from bags.formats.rosbag2.message_types import resolve_type_if_known
from bags.formats.rosbag2.qos import profile_to_offer
from bags.topic import CDR, RawMessage, Topic
from serd_ros.endpoints.qos import STATE_DEPTH, replay_qos
from serd_ros.endpoints.topic_types import message_class
from serd_ros.errors import NodeError

_CONFIRMED_WITHIN = Duration(seconds=10.0)
_UNCONFIRMED_AT_MOST = STATE_DEPTH // 2


class ReplayPublishers:
    """skipped: topics whose messages are not CDR, or of which there is no class; their types."""

    def __init__(self, node: Node, topics: Iterable[Topic]) -> None:
        self._node = node
        self.skipped: dict[str, str] = {}
        self._of: dict[str, Publisher] = {}
        self._n_unconfirmed: Counter[str] = Counter()
        for topic in topics:
            message = message_class(resolve_type_if_known(topic.message_type))
            if message is None or topic.encoding != CDR:
                self.skipped[topic.name] = topic.type_name
                continue
            profile = replay_qos(profile_to_offer(topic.qos))
            self._of[topic.name] = node.create_publisher(message, topic.name, profile)
        if not self._of:
            types = ", ".join(sorted(set(self.skipped.values()))) or "nothing"
            raise NodeError(f"bag must hold a topic of messages in CDR, got {types}")

    @property
    def topics(self) -> Collection[str]:
        """Topics that can be played."""
        return self._of.keys()

    def publish(self, messages: Iterable[RawMessage]) -> None:
        """Send them; at times wait for reliable readers, so that none is overrun.

        DDS requests acknowledgements only every few seconds, so it is done rarely.
        """
        for message in messages:
            topic = message.topic
            self._of[topic].publish(message.data)
            self._n_unconfirmed[topic] += 1
            if self._n_unconfirmed[topic] >= _UNCONFIRMED_AT_MOST:
                self._confirm(topic)

    def finish(self) -> None:
        """Wait until everything has arrived."""
        for topic in list(self._n_unconfirmed):
            self._confirm(topic)

    def close(self) -> None:
        """End all topics."""
        for publisher in self._of.values():
            self._node.destroy_publisher(publisher)
        self._of.clear()

    def _confirm(self, topic: str) -> None:
        self._n_unconfirmed[topic] = 0
        publisher = self._of[topic]
        if publisher.qos_profile.reliability == ReliabilityPolicy.RELIABLE:
            publisher.wait_for_all_acked(_CONFIRMED_WITHIN)

    @property
    def has_subscriber(self) -> bool:
        """Whether any topic has a subscriber."""
        return any(publisher.get_subscription_count() for publisher in self._of.values())
