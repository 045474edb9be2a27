"""A node ends between two callbacks after a signal, whenever the signal arrives; exit codes."""

import os
import signal
import subprocess
import sys

import pytest
import rclpy
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from serd_ros.nodes.teleop_mux import TeleopJoyNode
from serd_ros.process.run_node import run_node
from support.waiting import PATIENCE_S

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@pytest.fixture(autouse=True)
def handlers():
    """The handlers of the test's process come back."""
    before = {each: signal.getsignal(each) for each in SIGNALS}
    yield
    for each, handler in before.items():
        signal.signal(each, handler)


@pytest.fixture
def own_domain(monkeypatch, ros_env):
    for name in ("ROS_LOG_DIR", "ROS_DOMAIN_ID"):
        monkeypatch.setenv(name, ros_env[name])


def in_own_domain(test):
    return pytest.mark.ros(pytest.mark.usefixtures("own_domain")(test))


@in_own_domain
@pytest.mark.parametrize("number", SIGNALS)
@pytest.mark.parametrize(
    ("n_before", "n_after", "ends"), [(1, 0, ["teleop_joy"]), (0, 1, ["teleop_joy"]), (1, 1, [])]
)
def test_a_signal_ends_a_node_once_it_is_constructed_and_a_second_one_at_once(
    n_before, n_after, ends, number
):
    ended = []

    class Interrupted(TeleopJoyNode):
        def __init__(self):
            for _ in range(n_before):
                os.kill(os.getpid(), number)
            super().__init__("teleop_joy")
            for _ in range(n_after):
                os.kill(os.getpid(), number)

        def close(self):
            ended.append(self.get_name())

    assert run_node(Interrupted) == 0
    assert ended == ends
    assert not rclpy.ok()


@in_own_domain
def test_a_node_with_an_internal_error_ends_with_exit_code_1(capfd):
    def make_node():
        node = TeleopJoyNode("teleop_joy")

        def fail_once():
            node.finish(0)
            raise RuntimeError("fault of a test")

        node.endpoints.every(0.01, fail_once)
        return node

    assert run_node(make_node) == 1
    assert "teleop_joy: 1 internal errors, logged above" in capfd.readouterr().err


@in_own_domain
@pytest.mark.parametrize("fault", ["a service that is gone", "no response"])
def test_an_answer_that_cannot_be_sent_ends_no_node(fault):
    asked, sent = [], []

    def make_node():
        node = TeleopJoyNode("teleop_joy")
        scope = node.endpoints.scope()

        def end_service(_):
            asked.append(True)
            node.endpoints.destroy(scope)
            return "too late"

        if fault == "no response":
            node.create_service(Trigger, "ask", lambda *_: asked.append(True))
        else:
            scope.serve(Trigger, "ask", end_service)
        client = node.endpoints.client(Trigger, "ask")

        def look():
            if asked:
                node.finish(0)
            elif client.service_is_ready() and not sent:
                sent.append(client.call_async(Trigger.Request()))

        node.endpoints.every(0.01, look)
        return node

    assert run_node(make_node) == 0
    assert asked


HANGING_NODE = """
import ctypes
from serd_ros.nodes.teleop_mux import TeleopJoyNode
from serd_ros.process.run_node import run_node


class Hanging(TeleopJoyNode):
    def __init__(self):
        super().__init__("teleop_joy")
        self.finish(2)

    def close(self):
        print("closed")

    def destroy_node(self):
        ctypes.PyDLL(None).pause()


raise SystemExit(run_node(Hanging))
"""


@in_own_domain
def test_a_node_that_the_middleware_never_destroys_ends_with_its_exit_code():
    program = [sys.executable, "-c", HANGING_NODE]
    ended = subprocess.run(program, stdout=subprocess.PIPE, text=True, check=False)
    assert (ended.returncode, ended.stdout) == (2, "closed\n")


MANY = 1_000_000


def received_by_a_node(n_answers, n_first):
    """Run a node that sends messages to itself; how many it received until it ended.

    n_answers: how many it sends in answer to the message of this number.
    """
    n_received = 0

    def make_node():
        node = TeleopJoyNode("teleop_joy")
        publisher = node.create_publisher(Bool, "own", 1000)

        def publish(count):
            for _ in range(count):
                publisher.publish(Bool())

        def receive(_):
            nonlocal n_received
            n_received += 1
            if n_received == 1:
                os.kill(os.getpid(), signal.SIGTERM)
            publish(n_answers(n_received))

        node.create_subscription(Bool, "own", receive, 1000)
        publish(n_first)
        return node

    assert run_node(make_node) == 0
    return n_received


@in_own_domain
def test_a_signal_ends_a_node_that_receives_more_than_it_can_process():
    """Its executor finds the next event before it looks at the time."""
    assert received_by_a_node(lambda number: int(number < MANY), n_first=5) < MANY


@in_own_domain
def test_after_a_signal_a_node_takes_what_it_has_received_before(monkeypatch):
    monkeypatch.setattr("serd_ros.process.run_node._BACKLOG_S", PATIENCE_S)
    assert received_by_a_node(lambda number: 300 * (number == 1), n_first=1) == 301
