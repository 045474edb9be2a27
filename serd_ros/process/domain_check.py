"""Whether another stack already publishes a world in this ROS domain.

`python -m serd_ros.process.domain_check TOPIC ...` prints which nodes publish one of the topics and
ends with 2, or with 0 where none does. The end of discovery cannot be seen, so it waits until two
participants of its own have found each other, and as long again for others.
"""

import sys
from collections.abc import Sequence

import rclpy
from rclpy.context import Context
from rclpy.node import Node

from serd_ros.endpoints.world.worlds import (
    FIX,
    LONGEST_END_S,
    publishers_of,
    wait_at_most,
    wait_for_discovery,
)
from serd_ros.process.exit_limit import process_ends_within
from serd_ros.process.serd_node import BAD_INPUT, INTERNAL_ERROR


def main(*topics: str) -> int:
    """Entry point of the process."""
    nodes = []
    exit_code = INTERNAL_ERROR
    try:
        for number in range(2):
            context = Context()
            rclpy.init(context=context)
            nodes.append(rclpy.create_node(f"serd_start_check_{number}", context=context))
        wait_for_discovery(nodes)
        if sentence := _others(nodes[0], topics):
            print(f"waiting up to {LONGEST_END_S:g} s: {sentence}", file=sys.stderr, flush=True)
        wait_at_most(LONGEST_END_S, lambda: not _others(nodes[0], topics))
        sentence = _others(nodes[0], topics)
        if sentence:
            print(sentence, flush=True)
        exit_code = BAD_INPUT if sentence else 0
    finally:
        with process_ends_within(exit_code):
            for node in nodes:
                node.destroy_node()
                node.context.try_shutdown()
    return exit_code


def _others(node: Node, topics: Sequence[str]) -> str:
    for topic in topics:
        if names := publishers_of(node, topic):
            domain = node.context.get_domain_id()
            return (
                f"{topic} must have no publisher in ROS domain {domain} before a simulator starts,"
                f" got {', '.join(names)}; {FIX}"
            )
    return ""


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
