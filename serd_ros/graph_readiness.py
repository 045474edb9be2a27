"""Whether all nodes a driver needs are there and all endpoints between them are matched."""

from collections.abc import Sequence

from rclpy.node import Node


def missing_endpoints(node: Node, required_nodes: Sequence[str]) -> str:
    """What is still missing, as words; empty when the first message cannot get lost.

    A node counts as there once the graph knows it; this node's publishers count as matched once
    each reaches every subscription the graph knows. The world repeats an unanswered tick, which
    covers endpoints between the others.
    """
    present = set(node.get_node_names())
    absent = [name for name in required_nodes if name not in present]
    if absent:
        return f"node {', '.join(absent)}"
    unmatched = [
        publisher.topic_name
        for publisher in node.publishers
        if publisher.get_subscription_count() < node.count_subscribers(publisher.topic_name)
    ]
    return f"subscribers of {', '.join(unmatched)}" if unmatched else ""
