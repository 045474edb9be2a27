"""Nodes that are constructed in the test's process, without an executor.

Callbacks of subscriptions and timers are called by hand, so that a test of thousands of messages
waits for nothing. The node's wall clock stands except for `wait`, so that a machine that is late
changes nothing.
"""

import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import rclpy
import yaml
from domain_coordinator import domain_id
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription

from serd_ros.convert.motion import to_odometry, to_pose_stamped
from serd_ros.convert.sensors import to_people_message
from serd_ros.graph.graph import class_of
from serd_ros.process.lifecycle import bring_up
from serd_ros.process.serd_node import SerdNode
from serd_sim.world.observation import Observation


def deliver(subscription: Subscription, message: Any) -> None:
    """Call a subscription as an executor does with a message that was received just now."""
    if subscription._callback_type is Subscription.CallbackType.WithMessageInfo:
        info = {"received_timestamp": time.time_ns(), "source_timestamp": 0}
        subscription.callback(message, info)
    else:
        subscription.callback(message)


class NodeInProcess:
    """published: how many messages went out by topic; sent: the last message of each.

    lifecycle: of a managed node, else None.
    """

    def __init__(self, node: SerdNode[Any]) -> None:
        self.node, self.lifecycle = node, bring_up(node)
        now_s = node.wall_s()
        self._waited_s = 0.0
        setattr(node, "wall_s", lambda: now_s + self._waited_s)  # noqa: B010
        self.published: Counter[str] = Counter()
        self.sent: dict[str, Any] = {}
        for publisher in node.publishers:
            self._watch(publisher)

    def _watch(self, publisher: Any) -> None:
        topic, publish = publisher.topic_name.strip("/"), publisher.publish

        def counted(message: Any) -> None:
            publish(message)
            self.published[topic] += 1
            self.sent[topic] = message

        publisher.publish = counted

    def wait(self, duration_s: float) -> None:
        """Advance the node's wall clock."""
        self._waited_s += duration_s

    def subscriptions(self, topic: str) -> list[Subscription]:
        """The node's subscriptions of a topic."""
        return [each for each in self.node.subscriptions if each.topic_name.strip("/") == topic]

    def receive(self, topic: str, message: Any) -> None:
        """Call every subscription of the topic with the message."""
        found = self.subscriptions(topic)
        assert found, f"{self.node.get_name()} does not subscribe to {topic}"
        for subscription in found:
            deliver(subscription, message)

    def observe(self, seen: Observation) -> None:
        """Receive the topics of an observation to which the node subscribes."""
        if self.subscriptions("pedestrians"):
            self.receive("pedestrians", to_people_message(seen.people, seen.time_s))
        self.receive("odom", to_odometry(seen, (0.0, 0.0, 0.0)))
        self.receive("robot_pose", to_pose_stamped(seen.pose, seen.time_s))

    @property
    def health(self) -> dict[str, str]:
        """The values of the status that was published last, with its `name` and `message`."""
        (status,) = self.sent["diagnostics"].status
        values = {each.key: each.value for each in status.values}
        return {"name": status.name, "message": status.message, **values}

    def call_timers(self) -> None:
        """Call every timer that runs once."""
        for timer in list(self.node.timers):
            if not timer.is_canceled():
                timer.callback()

    def call(self, service: str, request: Any) -> Any:
        """The response of a service of the node."""
        (found,) = [each for each in self.node.services if each.srv_name.split("/")[-1] == service]
        return found.callback(request, found.srv_type.Response())

    @property
    def work(self) -> Any:
        """What an active node does, which a managed node has apart."""
        return self.lifecycle.activity if self.lifecycle else self.node

    def set(self, **values: object) -> SetParametersResult:
        """The answer of the node's service to set these parameters together."""
        wanted = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
        request = SetParametersAtomically.Request(parameters=wanted)
        return self.call("set_parameters_atomically", request).result

    @property
    def rejected(self) -> Mapping[str, object]:
        """The values `rejected.TOPIC` of `diagnostics`."""
        return self.node.callbacks.values()

    def assert_alive(self) -> None:
        """No callback failed and nothing ended the node."""
        assert self.node.callbacks.n_internal_errors == 0
        assert not self.node.finished.done()


def needed_parameters(folder: Path, model: Path) -> dict[str, dict[str, object]]:
    """By node, the parameters without which it cannot run beside other tests."""
    return {
        "strategy": {"model": str(model)},
        "learner": {"output": str(folder / "learned.yaml")},
        "demo_recorder": {"output": str(folder / "bag")},
        "hallway_sim": {"people": 0},
        "teleop_page": {"port": 0},
        "watch_page": {"port": 0},
    }


@contextmanager
def other_participant(name: str, domain: int | str) -> Iterator[Node]:
    """A node of the test's own in a participant of its own.

    A node that is not destroyed stays in its domain, which the next test may get.
    """
    context = Context()
    context.init(domain_id=int(domain))
    try:
        node = rclpy.create_node(name, context=context)
        try:
            yield node
        finally:
            node.destroy_node()
    finally:
        context.try_shutdown()


@contextmanager
def node_in_process(
    kind: str, *, remappings: Sequence[str] = (), **parameters: object
) -> Iterator[NodeInProcess]:
    """The node with these parameters, in a ROS domain of its own; remappings: FROM:=TO."""
    arguments = ["--ros-args", "--log-level", "fatal"]
    for each in remappings:
        arguments += ["-r", each]
    for name, value in parameters.items():
        text = yaml.safe_dump(value, default_flow_style=True).removesuffix("\n...\n").strip()
        arguments += ["-p", f"{name}:={text}"]
    with domain_id() as domain:
        rclpy.init(
            args=arguments,
            domain_id=int(domain),
            signal_handler_options=SignalHandlerOptions.NO,
        )
        try:
            node = class_of(kind)(kind)
            try:
                yield NodeInProcess(node)
            finally:
                node.close()
                node.destroy_node()
        finally:
            rclpy.try_shutdown()
