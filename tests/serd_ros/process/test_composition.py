"""Nodes of one process exchange messages, in order and with all, without the middleware."""

from types import SimpleNamespace

import pytest
import rclpy
from domain_coordinator import domain_id
from geometry_msgs.msg import TwistStamped
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from serd_ros.endpoints import qos
from serd_ros.errors import NodeError
from serd_ros.nodes.composed import make_nodes
from serd_ros.process.composition import Composition
from serd_ros.process.serd_node import SerdNode
from serd_sim.safety.reasons import Source
from serd_sim.world.command import Command
from support.nodes_in_process import NodeInProcess
from support.waiting import wait_until

TRIO = ("hallway_sim", "local_planner", "guard")


ARGUMENTS = ["--ros-args", "--log-level", "fatal"]
for _name in ("local_planner", "guard"):
    ARGUMENTS += ["-p", f"{_name}:lockstep:=true", "-p", f"{_name}:required_nodes:=['']"]


@pytest.fixture
def ros(monkeypatch):
    """rclpy, with two of the nodes in lock-step; no composition afterwards."""
    monkeypatch.setattr(SerdNode, "composition", None)
    with domain_id() as domain:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        rclpy.init(args=ARGUMENTS, signal_handler_options=SignalHandlerOptions.NO)
        yield
        rclpy.try_shutdown()


@pytest.fixture
def node(ros):  # noqa: ARG001
    """A node by which names are resolved."""
    made = Node("namer", namespace="/floor1", cli_args=["--ros-args", "-r", "odom:=wheels"])
    yield made
    made.destroy_node()


def test_topics_between_the_nodes_are_local_and_no_others(node):
    composition = Composition(TRIO)
    between = ("odom", "robot_pose", "scan", "pedestrians", "cmd_vel_raw", "cmd_vel")
    assert all(composition.has(node, topic, qos.STATE) for topic in between)
    for outside in ("/clock", "diagnostics", "intent", "tf", "/odom", "floor1/odom"):
        assert not composition.has(node, outside, qos.STATE)
    assert composition.has(node, "/floor1/wheels", qos.STATE)  # its odom
    assert not composition.has(node, "odom", qos.LATCHED)
    assert not Composition(("local_planner", "guard")).has(node, "odom", qos.STATE)


def test_messages_arrive_in_order_and_after_the_callback_that_published_them():
    composition, seen = Composition(TRIO), []

    def answer(message):
        seen.append(("begin", message))
        if message < 3:
            composition.publish("/b", message + 1)
            composition.deliver()
        seen.append(("end", message))

    composition.subscribe("/a", answer)
    composition.subscribe("/b", answer)
    composition.subscribe("/b", lambda message: seen.append(("other", message)))
    composition.publish("/a", 1)
    composition.publish("/nobody", 7)
    assert seen == []
    composition.deliver()
    calls = [("begin", 1), ("end", 1), ("begin", 2), ("end", 2), ("other", 2)]
    assert seen == [*calls, ("begin", 3), ("end", 3), ("other", 3)]
    assert composition.n_subscriptions("/b") == 2
    assert composition.n_subscriptions("/nobody") == 0


def test_nothing_arrives_after_the_end_of_a_subscription():
    composition, seen = Composition(TRIO), []
    subscription = composition.subscribe("/a", seen.append)
    composition.publish("/a", 1)
    assert composition.unsubscribe(subscription)
    assert not composition.unsubscribe(subscription)
    composition.deliver()
    assert seen == []


def test_nothing_arrives_once_the_nodes_are_finished():
    composition, seen = Composition(TRIO), []
    composition.subscribe("/a", seen.append)
    for number in range(5):
        composition.publish("/a", number)
    composition.deliver(lambda: len(seen) == 2)
    assert seen == [0, 1]


def test_the_executor_has_its_turn_although_messages_never_end():
    composition, seen = Composition(TRIO), []

    def go_on(message):
        seen.append(message)
        composition.publish("/a", message + 1)

    composition.subscribe("/a", go_on)
    composition.publish("/a", 0)
    composition.deliver()
    assert len(seen) == 1000
    composition.deliver()
    assert seen == list(range(2000))


def test_an_error_keeps_what_waits():
    composition, seen = Composition(TRIO), []

    def fail(_):
        raise ValueError("no number")

    composition.subscribe("/a", fail)
    composition.subscribe("/a", seen.append)
    composition.publish("/a", 1)
    with pytest.raises(ValueError, match="no number"):
        composition.deliver()
    composition.deliver()
    assert seen == [1]


@pytest.mark.parametrize(
    ("names", "match"),
    [
        (["guard", "gaurd"], "node must be .*got 'gaurd'"),
        (["guard"], "at least two different ones, got guard"),
        (["guard", "guard"], "at least two different ones, got guard guard"),
        ([], "at least two different ones, got none"),
    ],
)
def test_names_that_cannot_be_composed_are_refused_with_the_fix(names, match):
    with pytest.raises(NodeError, match=match):
        make_nodes(names)


def with_ros(*arguments):
    """rclpy anew, with these arguments besides those of the fixture."""
    rclpy.shutdown()
    no = SignalHandlerOptions.NO
    rclpy.init(args=[*ARGUMENTS, *arguments], signal_handler_options=no)


@pytest.mark.parametrize(
    ("names", "arguments", "match"),
    [
        (["hallway_sim", "guard"], [], "hallway_sim must have lockstep: true"),
        (["local_planner", "guard"], ["-p", "local_planner:managed:=true"], "neither managed"),
        (
            ["local_planner", "guard"],
            ["-p", "guard:frame_prefix:=r1/"],
            "guard .* nor frame_prefix",
        ),
        (["local_planner", "guard"], ["-r", "__ns:=/floor1"], "no namespace .* got /floor1"),
        (
            ["local_planner", "guard"],
            ["-r", "local_planner:cmd_vel_raw:=cmd_vel_planner"],
            "/cmd_vel_raw must be published by one of local_planner, guard",
        ),
    ],
)
@pytest.mark.usefixtures("ros")
def test_nodes_that_need_a_process_each_are_refused_with_the_fix(names, arguments, match):
    with_ros(*arguments)
    with pytest.raises(NodeError, match=match):
        make_nodes(names)
    assert SerdNode.composition is None


@pytest.mark.usefixtures("ros")
def test_what_a_node_publishes_reaches_the_other_as_the_same_object():
    planner = make_nodes(["local_planner", "guard"])
    (guard,) = planner.companions
    (commands,) = [each for each in planner.publishers if each.topic_name == "/cmd_vel_raw"]
    assert commands.get_subscription_count() == 1
    assert planner.count_subscribers("cmd_vel_raw") == 1
    assert not [each for each in guard.subscriptions if each.topic_name == "/cmd_vel_raw"]
    planner._send(Command(0.25, -0.5), 1.5)
    assert not guard._waiting
    planner.composition.deliver()
    ((source, (time_ns, _)),) = guard._waiting.items()
    assert (source, time_ns) == (Source.COMMAND, 1_500_000_000)
    for each in (guard, planner):
        each.destroy_node()


@pytest.mark.usefixtures("ros")
def test_a_publisher_of_another_process_is_warned_of_once(monkeypatch):
    warnings = []
    planner = make_nodes(["local_planner", "guard"])
    (guard,) = planner.companions
    running = NodeInProcess(planner)
    logger = SimpleNamespace(warning=warnings.append)
    monkeypatch.setattr(planner, "get_logger", lambda: logger)
    running.call_timers()
    assert warnings == []
    other = Node("my_driver", namespace="/floor1")
    other.create_publisher(TwistStamped, "/cmd_vel_raw", 1)
    other.create_publisher(TwistStamped, "/cmd_vel", 1)
    wait_until(lambda: planner.count_publishers("/cmd_vel_raw") == 2)
    for _ in range(2):
        running.call_timers()
    (warning,) = warnings
    assert warning.startswith("/cmd_vel_raw of /floor1/my_driver is not received, because")
    for each in (other, guard, planner):
        each.destroy_node()
