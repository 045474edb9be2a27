"""One world per ROS domain and namespace: whether several nodes publish its clock or its pose."""

import time
from collections.abc import Callable, Sequence

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from std_msgs.msg import Empty

from serd_ros.convert.diagnostics import ERROR, OK
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.endpoints import Endpoints
from serd_ros.endpoints.followed_topic import FollowedTopic, Received
from serd_ros.endpoints.topic_types import TopicType
from serd_ros.process.exit_limit import process_ends_within
from serd_ros.process.serd_node import INTERNAL_ERROR

WORLD_TOPICS = (topics.CLOCK, topics.ROBOT_POSE)
FIX = (
    "end the other stack, or start one with another ROS_DOMAIN_ID, or by serd launch with a"
    " namespace"
)
_CLOCK_TYPE = TopicType("rosgraph_msgs/msg/Clock", qos.CLOCK)
_LOOK_PERIOD_S = 1.0
_LOOK_AGAIN_S, _AT_LEAST_S, _AT_MOST_S = 0.05, 0.5, 10.0
#: The middleware names the publishers of a killed process for 20 s.
LONGEST_END_S = 25.0


def publishers_of(node: Node, topic: str) -> list[str]:
    """Full names of the nodes that publish a topic, one for each publisher."""
    found = node.get_publishers_info_by_topic(topic)
    return sorted(f"{each.node_namespace.rstrip('/')}/{each.node_name}" for each in found)


def several_worlds(node: Node, world_topics: Sequence[str] = WORLD_TOPICS) -> str:
    """What must be, what is and the fix, where several publish a world; empty where none do."""
    for topic in world_topics:
        names = publishers_of(node, topic)
        if len(names) > 1:
            name = node.resolve_topic_name(topic)
            return f"one publisher of {name}, got {len(names)}: {', '.join(names)}; {FIX}"
    return ""


def wait_for_discovery(nodes: Sequence[Node]) -> None:
    """Wait until two participants have found each other, and as long again for others."""
    began_s = time.monotonic()
    names = [node.get_fully_qualified_name() for node in nodes]
    sent = [node.create_publisher(Empty, name, 1) for node, name in zip(nodes, names, strict=True)]
    wait_at_most(_AT_MOST_S, lambda: all(n.count_publishers(each) for n in nodes for each in names))
    time.sleep(max(_AT_LEAST_S, time.monotonic() - began_s))
    for node, publisher in zip(nodes, sent, strict=True):
        node.destroy_publisher(publisher)


def wait_at_most(longest_s: float, condition: Callable[[], bool]) -> None:
    """Wait until the condition holds."""
    until_s = time.monotonic() + longest_s
    while not condition() and time.monotonic() < until_s:
        time.sleep(_LOOK_AGAIN_S)


def _discover(node: Node) -> None:
    """Wait until the node has discovered the publishers of its domain."""
    context = Context()
    rclpy.init(context=context, domain_id=node.context.get_domain_id())
    other = rclpy.create_node(f"{node.get_name()}_check", context=context)
    try:
        wait_for_discovery([node, other])
    finally:
        with process_ends_within(INTERNAL_ERROR):
            other.destroy_node()
            context.try_shutdown()


class OtherClocks:
    """Ends a simulator that receives messages of another one on its clock.

    Messages of one publisher have increasing numbers, so one with a number that was received
    before, or that this node has not sent yet, is of another. A publisher alone is no reason: the
    middleware names a killed process for up to 20 s.

    n_sent: how many messages this node has published on the clock; on_free: called once, when the
    clock has no other publisher. While there is one without messages, as of a world that is paused,
    the world does not begin, and the node ends after `LONGEST_END_S`.
    """

    def __init__(
        self, endpoints: Endpoints, n_sent: Callable[[], int], on_free: Callable[[], None]
    ) -> None:
        self._node, self._endpoints = endpoints.node, endpoints
        self._n_sent, self._newest, self._reported = n_sent, 0, ""
        self._on_free: Callable[[], None] | None = on_free
        self._clock: FollowedTopic | None = None
        _discover(self._node)
        self._until_s = self._node.wall_s() + LONGEST_END_S
        endpoints.every(_LOOK_PERIOD_S, self._look)

    def _look(self) -> None:
        """Report several publishers when that changes, and receive while there are."""
        names = publishers_of(self._node, topics.CLOCK)
        several = several_worlds(self._node) if len(names) > 1 else ""
        if self._on_free is not None:
            self._begin_when_free(several)
        if several and self._clock is None:
            name = self._node.resolve_topic_name(topics.CLOCK)
            self._clock = FollowedTopic(self._endpoints, name, _CLOCK_TYPE, self._take)
        elif not several and self._clock is not None:
            self._clock.close()
            self._clock = None
        if several != self._reported:
            self._reported = several
            level, message = (ERROR, f"there must be {several}") if several else (OK, "")
            values = {"publishers": len(names)}
            self._node.report(0.0, values, level=level, message=message, part="clock")
            if several:
                self._node.get_logger().error(message)

    def _begin_when_free(self, several: str) -> None:
        begin = self._on_free
        if self._n_sent():
            self._on_free = None  # it was reset, which began the world
        elif not several and begin is not None:
            self._on_free = None
            begin()
        elif self._node.wall_s() > self._until_s:
            self._node.fail(f"there must be {several}")

    def _take(self, message: Received) -> None:
        number = message.number
        if not number:
            return  # the middleware does not number messages
        if self._newest < number <= self._n_sent():
            self._newest = number
        else:
            self._node.fail(f"there must be {several_worlds(self._node) or 'one clock'}")
