"""Node processes and a probe node for whole-stack tests."""

import contextlib
import signal
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from rclpy.executors import SingleThreadedExecutor, TimeoutException
from rclpy.node import Node
from rclpy.qos import QoSProfile

from serd_cli.processes.workspace import stack_processes
from serd_ros.convert.motion import to_pose_stamped
from serd_ros.endpoints import qos
from serd_ros.graph.graph import find_stack
from support.changed_scenario import changed_scenario
from support.node_processes import STANDIN, NodeProcess, is_node
from support.nodes_in_process import other_participant
from support.waiting import LOCKSTEP_TIMEOUT_S, PATIENCE_S, wait_until

Process = NodeProcess | subprocess.Popen[bytes]


class Nodes:
    """Started node processes; all of them are ended and waited for."""

    def __init__(self, environment: dict[str, str], logs: Path) -> None:
        self._environment, self._logs = environment, logs
        self._started: dict[str, Process] = {}
        self._commands: dict[str, list[str]] = {}

    def start(self, command: list[str], name: str) -> Process:
        """Run a command; a node is forked from a process that has its modules."""
        path = self._logs / f"{name}.log"
        if is_node(command):
            process: Process = NodeProcess(command, self._environment, path)
        else:
            with path.open("ab") as log:
                process = subprocess.Popen(
                    command, env=self._environment, stdout=log, stderr=subprocess.STDOUT
                )
        self._started[name], self._commands[name] = process, command
        return process

    def kill(self, name: str) -> None:
        """End a node by SIGKILL."""
        self._started[name].kill()
        self._started[name].wait()

    def restart(self, name: str) -> Process:
        """Start a node that has ended again, with the same command."""
        return self.start(self._commands[name], name)

    def start_stack(
        self, stack: str, *, namespace: str = "", **given: object
    ) -> dict[str, Process]:
        """Start every node of a stack; a parameter of one node is written node__parameter.

        A world in lock-step waits as long as a test for commands that a busy machine delays.
        """
        found = find_stack(stack)
        assignments = {name.replace("__", "."): value for name, value in given.items()}
        if "hallway_sim" in found.nodes:
            assignments.setdefault("lockstep_timeout_s", LOCKSTEP_TIMEOUT_S)
        environment = self._environment
        processes = stack_processes(found, assignments, environment, namespace)
        return {each.name: self.start(list(each.command), each.name) for each in processes}

    def log_of(self, name: str) -> str:
        """What a node has printed."""
        return (self._logs / f"{name}.log").read_text()

    def end_all(self) -> None:
        """Ask all of them to end and wait for it; a node that hangs is killed."""
        for process in self._started.values():
            if process.poll() is None:
                process.send_signal(signal.SIGTERM)
                process.send_signal(signal.SIGCONT)
        for process in self._started.values():
            try:
                process.wait(PATIENCE_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


@pytest.fixture
def nodes(ros_env: dict[str, str], tmp_path: Path) -> Iterator[Nodes]:
    running = Nodes(ros_env, tmp_path)
    yield running
    running.end_all()


class Probe:
    """A node of the test's own in the domain of the test, spun by hand."""

    def __init__(self, node: Node) -> None:
        self.node = node
        self._goals = node.create_publisher(PoseStamped, "goal_pose", qos.COMMAND)
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(self.node)

    def subscribe(
        self,
        kind: type,
        topic: str,
        take: Callable[..., object],
        profile: QoSProfile = qos.STATE,
    ) -> None:
        """Call `take` with each message."""
        self.node.create_subscription(kind, topic, take, profile)

    def health(self) -> list[DiagnosticStatus]:
        """All statuses that come on `diagnostics` from now on."""
        found: list[DiagnosticStatus] = []
        self.subscribe(DiagnosticArray, "diagnostics", lambda message: found.extend(message.status))
        return found

    def send_goal(self, x_m: float, y_m: float) -> None:
        """Publish a goal without a heading once a node subscribes to it."""
        self.spin_until(self._goals.get_subscription_count)
        goal = to_pose_stamped((x_m, y_m, 0.0), 0.0)
        goal.pose.orientation.w = 0.0
        self._goals.publish(goal)

    def spin_until(
        self, condition: Callable[[], object], *, seen: Callable[[], object] = lambda: ""
    ) -> None:
        """Take messages until the condition holds; seen: as in `wait_until`."""
        wait_until(condition, turn=self.spin_once, seen=seen)

    def spin_once(self) -> None:
        """Take a message, or wait for one for a moment."""
        self._executor.spin_once(timeout_sec=0.05)

    def spin_all(self) -> None:
        """Take all messages that wait, so that what is known is as new as possible."""
        with contextlib.suppress(TimeoutException):
            while True:
                handler, *_ = self._executor.wait_for_ready_callbacks(timeout_sec=0.0)
                handler()


@contextmanager
def probing(environment: dict[str, str]) -> Iterator[Probe]:
    with other_participant("probe", environment["ROS_DOMAIN_ID"]) as node:
        yield Probe(node)


@pytest.fixture
def quick_hallway(tmp_path: Path) -> str:
    """The hallway in half as many steps, with the robot that costs least."""
    changes = {
        "control_period_s: 0.05": "control_period_s: 0.1",
        "drive: physical": "drive: kinematic",
    }
    return str(changed_scenario(tmp_path, "hallway", changes))


@pytest.fixture
def start_robot(nodes: Nodes) -> Callable[..., Process]:
    """Starts a stand-in robot of lab.faults.robots with these options."""

    def start(*options: object, robot: str = "spinning") -> Process:
        return nodes.start([*STANDIN, robot, *map(str, options)], "standin_robot")

    return start


@pytest.fixture
def probe(ros_env: dict[str, str], monkeypatch: pytest.MonkeyPatch) -> Iterator[Probe]:
    monkeypatch.setenv("ROS_LOG_DIR", ros_env["ROS_LOG_DIR"])
    with probing(ros_env) as running:
        yield running
