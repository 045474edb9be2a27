"""Nodes of one process exchange the messages of their topics without the middleware.

What a node publishes reaches the others as the object that it is, in the order of publishing, after
the callback that published it has returned; other processes receive it from the middleware as
before. On these topics the process receives nothing from other processes, and `ros2 topic info`
does not count its subscriptions.
"""

from collections import deque
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from serd_ros.graph.graph import load_graph

Callback = Callable[..., None]
#: Messages that are delivered before the executor calls other callbacks.
_MOST_IN_A_ROW = 1000


@dataclass(frozen=True, eq=False)
class LocalSubscription:
    """A subscription to a topic of this process."""

    topic_name: str
    callback: Callback


class Composition:
    """The topics that the named nodes publish and subscribe to."""

    def __init__(self, nodes: Collection[str]) -> None:
        described = [load_graph().nodes[node] for node in nodes]
        published = {topic for each in described for topic in each.publishes}
        self._topics = published & {topic for each in described for topic in each.subscribes}
        self._publishers: dict[str, list[str]] = {}
        self._subscriptions: dict[str, list[LocalSubscription]] = {}
        self._waiting: deque[tuple[LocalSubscription, Any]] = deque()
        self._is_delivering = False

    def has(self, node: Node, topic: str, profile: QoSProfile | int) -> bool:
        """Whether messages of a topic, as a node names it, are local; latched ones never are."""
        if isinstance(profile, QoSProfile) and profile.durability != DurabilityPolicy.VOLATILE:
            return False
        name = node.resolve_topic_name(topic)
        return any(name == node.resolve_topic_name(each) for each in self._topics)

    def subscribe(self, topic_name: str, callback: Callback) -> LocalSubscription:
        """Take the messages of a topic; topic_name: in full."""
        subscription = LocalSubscription(topic_name, callback)
        self._subscriptions.setdefault(topic_name, []).append(subscription)
        return subscription

    def unsubscribe(self, subscription: LocalSubscription) -> bool:
        """Take no more messages; whether it took any until now."""
        found = self._subscriptions.get(subscription.topic_name, [])
        if subscription not in found:
            return False
        found.remove(subscription)
        return True

    def add_publisher(self, topic_name: str, node_name: str) -> None:
        """A node of the process publishes a topic; both names in full."""
        self._publishers.setdefault(topic_name, []).append(node_name)

    def publishers(self) -> dict[str, tuple[str, ...]]:
        """Topics of local subscriptions, each with the nodes of the process that publish it."""
        return {topic: tuple(self._publishers.get(topic, ())) for topic in self._subscriptions}

    def unpublished(self) -> list[str]:
        """Topics of local subscriptions that no node of the process publishes."""
        return sorted(set(self._subscriptions) - self._publishers.keys())

    def n_subscriptions(self, topic_name: str) -> int:
        """How many there are to a topic."""
        return len(self._subscriptions.get(topic_name, ()))

    def publish(self, topic_name: str, message: Any) -> None:
        """Keep a message for those who subscribe to its topic."""
        for each in self._subscriptions.get(topic_name, ()):
            self._waiting.append((each, message))

    def deliver(self, is_finished: Callable[[], bool] = lambda: False) -> None:
        """Call back with what has been published, and with what is published then.

        Not from within itself, and not once the nodes are finished.
        """
        if self._is_delivering:
            return
        self._is_delivering = True
        try:
            for _ in range(_MOST_IN_A_ROW):
                if not self._waiting or is_finished():
                    break
                subscription, message = self._waiting.popleft()
                if subscription in self._subscriptions[subscription.topic_name]:
                    subscription.callback(message)
        finally:
            self._is_delivering = False
