"""Node processes and a probe node for whole-stack tests."""

import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from serd_cli.node_commands import stack_processes
from serd_ros.graph.graph import find_stack

ENDING_S = 15.0


class Nodes:
    """Started node processes; all of them are ended and waited for."""

    def __init__(self, environment: dict[str, str], logs: Path) -> None:
        self._environment, self._logs = environment, logs
        self._started: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, command: list[str], name: str) -> subprocess.Popen[bytes]:
        with (self._logs / f"{name}.log").open("ab") as log:
            process = subprocess.Popen(
                command, env=self._environment, stdout=log, stderr=subprocess.STDOUT
            )
        self._started[name] = process
        return process

    def start_stack(self, stack: str, **given: object) -> dict[str, subprocess.Popen[bytes]]:
        """Start every node of a stack; a parameter of one node is written node__parameter."""
        assignments = {name.replace("__", "."): value for name, value in given.items()}
        processes = stack_processes(find_stack(stack), assignments, self._environment)
        return {each.name: self.start(list(each.command), each.name) for each in processes}

    def said(self, name: str) -> str:
        return (self._logs / f"{name}.log").read_text()

    def end_all(self) -> None:
        for process in self._started.values():
            if process.poll() is None:
                process.send_signal(signal.SIGTERM)
        for process in self._started.values():
            try:
                process.wait(ENDING_S)
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

    def __init__(self, context: Context) -> None:
        self.node: Node = rclpy.create_node("probe", context=context)
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self.node)

    def spin_until(self, condition: Callable[[], bool], limit_s: float = 30.0) -> None:
        deadline = time.monotonic() + limit_s
        while not condition():
            assert time.monotonic() < deadline, f"did not happen within {limit_s} s"
            self._executor.spin_once(timeout_sec=0.05)

    def spin_for(self, duration_s: float) -> None:
        deadline = time.monotonic() + duration_s
        while time.monotonic() < deadline:
            self._executor.spin_once(timeout_sec=0.02)


@contextmanager
def probing(environment: dict[str, str]) -> Iterator[Probe]:
    context = Context()
    context.init(domain_id=int(environment["ROS_DOMAIN_ID"]))
    probe = Probe(context)
    try:
        yield probe
    finally:
        probe.node.destroy_node()
        context.try_shutdown()


@pytest.fixture
def probe(ros_env: dict[str, str], monkeypatch: pytest.MonkeyPatch) -> Iterator[Probe]:
    monkeypatch.setenv("ROS_LOG_DIR", ros_env["ROS_LOG_DIR"])
    with probing(ros_env) as running:
        yield running
