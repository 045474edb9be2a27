"""What every node of the stack shares: one config, guarded callbacks, diagnostics, a clean end."""

import sys
from collections.abc import Callable, Mapping
from typing import Any, Generic, TypeVar

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.service import Service
from rclpy.subscription import Subscription
from rclpy.task import Future
from rclpy.timer import Timer
from rosgraph_msgs.msg import Clock as ClockMessage

from serd_ros.convert.diagnostics import ERROR, OK, WARN, to_diagnostics
from serd_ros.convert.stamp import Jump, stamp_ns
from serd_ros.endpoints import qos, topics
from serd_ros.graph.configs import NodeConfig
from serd_ros.graph.parameters import read_config
from serd_ros.process.callback_guard import CallbackGuard

Config = TypeVar("Config", bound=NodeConfig)
BAD_INPUT = 2
_INPUT_REPORT_PERIOD_S = 1.0


class SerdNode(Node, Generic[Config]):
    """A node with a frozen config; `finish` ends its process from inside a callback."""

    def __init__(self, kind: str, config_class: type[Config]) -> None:
        # Before rclpy makes its own endpoints, which are guarded too.
        self.callbacks = CallbackGuard(self, self.fail)
        self._reported_counts = (0, 0)
        super().__init__(kind, automatically_declare_parameters_from_overrides=True)
        self.config: Config = read_config(self, kind, config_class)
        self.finished = Future()
        self.wall_clock = Clock(clock_type=ClockType.STEADY_TIME)
        self._diagnostics = self.create_publisher(DiagnosticArray, topics.DIAGNOSTICS, qos.STATE)
        self.create_timer(_INPUT_REPORT_PERIOD_S, self._report_input, clock=self.wall_clock)

    def create_subscription(
        self, msg_type: Any, topic: str, callback: Callable[..., None], *args: Any, **options: Any
    ) -> Subscription:
        """As rclpy's, with a guarded callback; that of /clock gets sound stamps only."""
        if msg_type is ClockMessage and not options.get("raw"):
            callback = _of_times(callback)
        guarded = self.callbacks.of_messages(topic, callback)
        return super().create_subscription(msg_type, topic, guarded, *args, **options)

    def create_service(
        self,
        srv_type: Any,
        srv_name: str,
        callback: Callable[[Any, Any], Any],
        *args: Any,
        **options: Any,
    ) -> Service:
        """As rclpy's, with a guarded callback."""
        guarded = self.callbacks.of_requests(srv_name, callback)
        return super().create_service(srv_type, srv_name, guarded, *args, **options)

    def create_timer(
        self, timer_period_sec: float, callback: Callable[[], None], *args: Any, **options: Any
    ) -> Timer:
        """As rclpy's, with a guarded callback."""
        guarded = self.callbacks.of_timer(callback)
        return super().create_timer(timer_period_sec, guarded, *args, **options)

    def clock_jumped(self, jump: Jump) -> None:
        """The clock of the observations jumped; called before the observation that shows it.

        FORWARD: what was received before is stale. BACKWARD: a new session begins.
        """

    def finish(self, exit_code: int = 0) -> None:
        """Let the process end with this code once the running callback has returned."""
        if not self.finished.done():
            self.finished.set_result(exit_code)

    def fail(self, sentence: str) -> None:
        """End the process with exit code 2 and this sentence as its last line."""
        if not self.finished.done():
            print(f"{self.get_name()}: {sentence}", file=sys.stderr, flush=True)
            self.finish(BAD_INPUT)

    def close(self) -> None:
        """Release what the node holds; called once before it is destroyed."""

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

    def _report_input(self) -> None:
        """Publish what was dropped when it has changed, as a status of its own."""
        counts = self.callbacks.n_rejected, self.callbacks.n_internal_errors
        if counts != self._reported_counts:
            self._reported_counts = counts
            self._diagnostics.publish(
                to_diagnostics(
                    f"{self.get_name()}: input",
                    0.0,
                    self.callbacks.values(),
                    level=ERROR if self.callbacks.n_internal_errors else WARN,
                    message="input dropped",
                )
            )

    def wall_s(self) -> float:
        """Steady wall time, independent of /clock."""
        return self.wall_clock.now().nanoseconds * 1e-9


def _of_times(callback: Callable[[ClockMessage], None]) -> Callable[[ClockMessage], None]:
    """The callback of /clock for stamps that are times, since rclpy checks none."""

    def checked(message: ClockMessage) -> None:
        stamp_ns(message.clock)
        callback(message)

    return checked
