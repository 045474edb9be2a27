"""Whether all required nodes subscribe, so that the first message of a recording is not lost.

The graph description has how many of the required nodes subscribe to each topic; what DDS has
matched so far is counted against that. A node may be configured to subscribe to less than that, so
after a while it is enough that all known subscriptions are matched.
"""

from collections.abc import Sequence

from rclpy.node import Node
from rclpy.publisher import Publisher

from serd_ros.graph.graph import load_graph

PATIENCE_S = 10.0


class Readiness:
    """Looks at one node's publishers; `required_nodes` must be present in its namespace."""

    def __init__(self, node: Node, required_nodes: Sequence[str], now_s: float) -> None:
        # A ROS parameter cannot be an empty list, so none is written [""].
        self._required = tuple(name for name in required_nodes if name)
        self._node, self._since_s = node, now_s

    def missing(self, now_s: float) -> str:
        """What is missing, as words; empty when ready. now_s: steady wall time."""
        here = self._node.get_namespace()
        present = self._node.get_node_names_and_namespaces()
        absent = [name for name in self._required if (name, here) not in present]
        if absent:
            return f"node {', '.join(absent)}"
        patient = now_s - self._since_s < PATIENCE_S
        short = [
            publisher.topic_name
            for publisher in self._node.publishers
            if publisher.get_subscription_count() < self._needed(publisher, patient)
        ]
        return f"subscribers of {', '.join(short)}" if short else ""

    def _needed(self, publisher: Publisher, patient: bool) -> int:
        """How many subscriptions a publisher must have matched."""
        known = int(self._node.count_subscribers(publisher.topic_name))
        return max(known, self._described(publisher.topic_name)) if patient else known

    def _described(self, topic_name: str) -> int:
        nodes = load_graph().nodes
        return sum(
            topic_name == self._node.resolve_topic_name(topic)
            for name in self._required
            if name in nodes
            for topic in nodes[name].subscribes
        )
