"""What every node of the stack shares: one config, diagnostics and a clean end."""

import sys
from collections.abc import Mapping
from typing import Generic, TypeVar

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future

from serd_ros.convert.diagnostics import OK, to_diagnostics
from serd_ros.endpoints import qos, topics
from serd_ros.graph.configs import NodeConfig
from serd_ros.graph.parameters import read_config

Config = TypeVar("Config", bound=NodeConfig)
BAD_INPUT = 2


class SerdNode(Node, Generic[Config]):
    """A node with a frozen config; `finish` ends its process from inside a callback."""

    def __init__(self, kind: str, config_class: type[Config]) -> None:
        super().__init__(kind, automatically_declare_parameters_from_overrides=True)
        self.config: Config = read_config(self, kind, config_class)
        self.finished = Future()
        self.wall_clock = Clock(clock_type=ClockType.STEADY_TIME)
        self._diagnostics = self.create_publisher(DiagnosticArray, topics.DIAGNOSTICS, qos.STATE)

    def finish(self, exit_code: int = 0) -> None:
        """Let the process end with this code once the running callback has returned."""
        if not self.finished.done():
            self.finished.set_result(exit_code)

    def fail(self, sentence: str) -> None:
        """End the process with exit code 2 and this sentence as its last word."""
        if not self.finished.done():
            print(f"{self.get_name()}: {sentence}", file=sys.stderr, flush=True)
            self.finish(BAD_INPUT)

    def close(self) -> None:
        """Give back what the node holds; called once before it is destroyed."""

    def report(
        self,
        time_s: float,
        values: Mapping[str, object],
        *,
        level: bytes = OK,
        message: str = "",
    ) -> None:
        """Publish the node's health and numbers on `diagnostics`."""
        self._diagnostics.publish(
            to_diagnostics(self.get_name(), time_s, values, level=level, message=message)
        )

    def wall_s(self) -> float:
        """Steady wall time, whatever /clock says."""
        return self.wall_clock.now().nanoseconds * 1e-9
