"""Whether all required nodes subscribe, so that the first message of a recording is not lost.

The graph description has how many of the required nodes subscribe to each topic; what DDS has
matched so far is counted against that. A node may be configured to subscribe to less than that, so
after a while in which no node and no subscription has appeared it is enough that all known ones are
matched. A node is present before it subscribes, on a busy machine many seconds.
"""

from collections.abc import Sequence

from rclpy.node import Node

from serd_ros.graph.graph import load_graph

PATIENCE_S = 10.0


class Readiness:
    """Looks at one node's publishers; `required_nodes` must be present in its namespace."""

    def __init__(self, node: Node, required_nodes: Sequence[str], now_s: float) -> None:
        # A ROS parameter cannot be an empty list, so none is written [""].
        self._required = tuple(name for name in required_nodes if name)
        self._node, self._since_s = node, now_s
        self._seen: tuple[int, ...] = ()
        self._was_ready = False

    def was_ready(self, now_s: float) -> bool:
        """Whether nothing is missing, or was before; the graph is looked at until then."""
        self._was_ready = self._was_ready or not self.missing(now_s)
        return self._was_ready

    def missing(self, now_s: float) -> str:
        """What is missing, as words; empty when ready. now_s: steady wall time."""
        here = self._node.get_namespace()
        present = self._node.get_node_names_and_namespaces()
        absent = [name for name in self._required if (name, here) not in present]
        publishers = list(self._node.publishers)
        known = [int(self._node.count_subscribers(each.topic_name)) for each in publishers]
        seen = len(absent), *known
        if seen != self._seen:
            self._seen, self._since_s = seen, now_s
        if absent:
            return f"node {', '.join(absent)}"
        if now_s - self._since_s < PATIENCE_S:
            described = [self._described(each.topic_name) for each in publishers]
            known = list(map(max, known, described))
        short = [
            publisher.topic_name
            for publisher, needed in zip(publishers, known, strict=True)
            if publisher.get_subscription_count() < needed
        ]
        return f"subscribers of {', '.join(short)}" if short else ""

    def _described(self, topic_name: str) -> int:
        nodes = load_graph().nodes
        return sum(
            topic_name == self._node.resolve_topic_name(topic)
            for name in self._required
            if name in nodes
            for topic in nodes[name].subscribes
        )
