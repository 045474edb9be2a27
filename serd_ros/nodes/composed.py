"""Several nodes of a lock-step stack in one process, which exchange messages as objects.

    ros2 run serd_ros composed hallway_sim local_planner guard --ros-args -p guard:lockstep:=true

Parameters and remappings of one node stand behind its name. One robot only, without namespace and
frame prefix. What one of the nodes takes from another must have one name in both.
"""

import os
import sys
from collections import Counter
from typing import Any

from rclpy.utilities import remove_ros_args

from serd_bag.nearest import choice_rule
from serd_ros.endpoints.world.worlds import publishers_of
from serd_ros.errors import NodeError
from serd_ros.graph.graph import COMPOSABLE
from serd_ros.process.composition import Composition
from serd_ros.process.executable import node_maker
from serd_ros.process.serd_node import SerdNode

_LOOK_PERIOD_S = 1.0


def nodes_of_arguments(_: str) -> SerdNode[Any]:
    """The nodes that the command line names."""
    # What others receive is sent by another thread, which nothing waits for: a tenth less time.
    os.environ.setdefault("RMW_FASTRTPS_PUBLICATION_MODE", "ASYNCHRONOUS")
    return make_nodes(remove_ros_args(sys.argv)[1:])


def make_nodes(names: list[str]) -> SerdNode[Any]:
    """The first of the nodes, with the others as companions."""
    for name in names:
        if name not in COMPOSABLE:
            raise NodeError(choice_rule("node", name, COMPOSABLE))
    if len(set(names)) < 2 or len(set(names)) < len(names):
        raise NodeError(
            f"nodes must be at least two different ones, got {' '.join(names) or 'none'}"
            f"; name some of {', '.join(COMPOSABLE)}"
        )
    composition = SerdNode.composition = Composition(names)
    made: list[SerdNode[Any]] = []
    try:
        for name in names:
            made.append(node_maker(name)())
            _require_plain(made[-1])
        if topics := composition.unpublished():
            raise NodeError(
                f"{', '.join(topics)} must be published by one of {', '.join(names)}, which take"
                " these topics from each other; leave the remapping out or start the nodes apart"
            )
    except BaseException:
        SerdNode.composition = None
        for each in made:
            each.close()
            each.destroy_node()
        raise
    for each in made[1:]:
        made[0].add_companion(each)
    others = _OtherPublishers(made[0], composition)
    made[0].create_timer(_LOOK_PERIOD_S, others.look)
    return made[0]


class _OtherPublishers:
    """Warns, once for each topic, of publishers of other processes, which no node receives."""

    def __init__(self, node: SerdNode[Any], composition: Composition) -> None:
        self._node, self._composition = node, composition
        self._reported: set[str] = set()

    def look(self) -> None:
        """Compare the graph with the publishers of this process."""
        for topic, own in self._composition.publishers().items():
            if topic in self._reported or self._node.count_publishers(topic) <= len(own):
                continue
            others = Counter(publishers_of(self._node, topic)) - Counter(own)
            if others:
                self._reported.add(topic)
                self._node.get_logger().warning(
                    f"{topic} of {', '.join(others)} is not received, because nodes of one process"
                    " take this topic from each other only; end that publisher, or start the nodes"
                    " apart, as serd launch does without composed:=true (one that was killed"
                    " remains for 20 s)"
                )


def _require_plain(node: SerdNode[Any]) -> None:
    """A node that answers each tick, of one robot, from its start to its end."""
    namespace, config = node.get_namespace(), node.config
    if namespace != "/":
        raise NodeError(
            f"{node.kind} must have no namespace to run in one process with others, got"
            f" {namespace}; leave it out or start the nodes apart"
        )
    if not config.lockstep or getattr(config, "managed", False) or node.frames.prefix:
        raise NodeError(
            f"{node.kind} must have lockstep: true, and neither managed nor frame_prefix, to run in"
            " one process with others; change them or start the nodes apart"
        )
