"""What every node of the stack has: one config, a clean end, its health on `diagnostics`."""

import json
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from typing import Any, ClassVar, Generic

from diagnostic_msgs.msg import DiagnosticArray
from pydantic import ValidationError
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle.node import LifecycleNodeMixin, LifecycleState
from rclpy.lifecycle.node import TransitionCallbackReturn as _Result
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from rosgraph_msgs.msg import Clock as ClockMessage

from serd_files.errors import USER_ERRORS
from serd_files.moved_names import where_or_near
from serd_files.settings import settings_of
from serd_files.yaml_config import sentence_of
from serd_ros.convert.diagnostics import ERROR, OK, WARN, to_diagnostics
from serd_ros.convert.frames import Frames
from serd_ros.convert.stamp import stamp_ns
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.endpoints import Endpoints
from serd_ros.errors import NodeError
from serd_ros.process.callback_guard import CallbackGuard
from serd_ros.settings import Config, ManagedConfig

INTERNAL_ERROR, BAD_INPUT = 1, 2
_LOOK_PERIOD_S = 1.0


class SerdNode(Node, Generic[Config]):
    """A node of rclpy with a frozen config.

    config: its parameters, of the class config_class. kind: its name in graph.yaml. endpoints:
    those that live as long as the node. frames: as /tf has them, where something follows it.
    at_end: what releases what the node holds, called before it is destroyed.
    """

    config_class: ClassVar[type[Any]]  # its Config

    def __init__(self, kind: str) -> None:
        self.kind = kind
        try:
            super().__init__(kind, automatically_declare_parameters_from_overrides=True)
        except ValueError:  # ROS makes a parameter without a value of an empty list
            given = self._parameter_overrides.items()
            names = [name for name, each in given if each.type_ is Parameter.Type.NOT_SET]
            if names:
                rule = f"{', '.join(names)} must have a value, got none; leave it out"
                raise NodeError(f"parameter of {kind}: {rule}") from None
            raise
        self.callbacks = CallbackGuard(self, self.fail)
        self.config: Config = declare(self, kind, type(self).config_class)
        self.frames = Frames(getattr(self.config, "frame_prefix", ""))
        self.finished, self.at_end = Future(), ExitStack()
        self.wall_clock = Clock(clock_type=ClockType.STEADY_TIME)
        self.endpoints = Endpoints(self)
        self._diagnostics = self.endpoints.publisher(DiagnosticArray, topics.DIAGNOSTICS, qos.STATE)
        self._reported_counts = 0, 0
        self.endpoints.every(_LOOK_PERIOD_S, self._look_around)
        self.guard_services()
        self._guard_clock()
        self.add_post_set_parameters_callback(lambda _: self._guard_clock())
        if isinstance(self.config, ManagedConfig):
            self.lifecycle = Lifecycle(self)

    def configure(self) -> "Activate":
        """Read and check what a managed node needs; returns what makes endpoints and begins."""
        raise NotImplementedError

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
        self.at_end.close()

    def wall_s(self) -> float:
        """Steady wall time, independent of /clock."""
        return time.monotonic()

    def now_s(self) -> float:
        """The time of the node's clock, which is /clock where `use_sim_time` is true."""
        return float(self.get_clock().now().nanoseconds * 1e-9)

    def report(
        self,
        time_s: float,
        values: Mapping[str, object],
        *,
        level: bytes = OK,
        message: str = "",
        part: str = "",
    ) -> None:
        """Publish health and numbers on `diagnostics`; part: what has a status of its own."""
        name = f"{self.kind}: {part}" if part else self.kind
        status = to_diagnostics(name, time_s, values, level=level, message=message)
        self._diagnostics.publish(status)

    def guard_services(self) -> None:
        """Guard rclpy's own services: a request of an unknown type raises in them."""
        for service in self.services:
            if service.callback.__module__.startswith("rclpy."):
                service.callback = self.callbacks.of_requests(service.srv_name, service.callback)

    def _guard_clock(self) -> None:
        """Guard rclpy's subscription of /clock, which exists while `use_sim_time` is true."""
        for each in self.subscriptions:
            if each.msg_type is ClockMessage and each.callback.__module__.startswith("rclpy."):
                sound = _of_times(each.callback)
                each.callback = self.callbacks.of_messages(topics.CLOCK, sound)

    def _look_around(self) -> None:
        self._report_input()
        self.endpoints.follow_publishers()

    def _report_input(self) -> None:
        """Publish what was dropped when it has changed, as a status of its own."""
        counts = self.callbacks.n_rejected, self.callbacks.n_internal_errors
        if counts != self._reported_counts:
            self._reported_counts = counts
            level = ERROR if self.callbacks.n_internal_errors else WARN
            values = self.callbacks.values()
            self.report(0.0, values, level=level, message="input dropped", part="input")


def _of_times(callback: Callable[[ClockMessage], None]) -> Callable[[ClockMessage], None]:
    """The callback of /clock for stamps that are times, since rclpy checks none."""

    def checked(message: ClockMessage) -> None:
        stamp_ns(message.clock)
        callback(message)

    return checked


ROS_OWN = ("use_sim_time", "start_type_description_service", "qos_overrides")


def declare(node: Node, kind: str, config_class: type[Config]) -> Config:
    """Declare each parameter of a node once, read-only; NodeError for a bad name or value."""
    given = {
        each.name: plain(each.value)  # declared by automatically_declare_parameters_from_overrides
        for each in node.get_parameters_by_prefix("").values()
        if not each.name.startswith(ROS_OWN)
    }
    for name in given:
        if name not in config_class.model_fields:
            near = where_or_near("parameter", name, config_class.model_fields)
            raise NodeError(f"{kind} has no parameter {name!r}; {near}")
    config = validated(kind, given, config_class)
    for each in settings_of(config_class):
        if node.has_parameter(each.name):
            node.undeclare_parameter(each.name)
        value = plain(getattr(config, each.name))
        node.declare_parameter(
            each.name,
            value,
            ParameterDescriptor(
                description=each.description, additional_constraints=each.range, read_only=True
            ),
            ignore_override=True,
        )
    return config


def validated(kind: str, given: Mapping[str, Any], config_class: type[Config]) -> Config:
    """The given values over the defaults; NodeError names the parameter, the rule and the value."""
    values = {**config_class.defaults(given), **given}
    try:
        return config_class.model_validate_json(json.dumps(values), strict=True)
    except ValidationError as error:
        sentence = sentence_of(error, config_class)
        raise NodeError(f"parameter of {kind}: {sentence}") from None


def plain(value: Any) -> Any:
    """The value of a parameter, a sequence as a list."""
    return list(value) if isinstance(value, (list, tuple)) or hasattr(value, "tolist") else value


class Activity:
    """The work of an active node: made at its activation, dropped at its deactivation."""

    def deactivate(self) -> None:
        """End the work; the process goes on, and the endpoints are destroyed afterwards."""
        self.close()

    def close(self) -> None:
        """End the work; the process ends."""


#: Makes endpoints and begins to work.
Activate = Callable[[Endpoints], Activity]


class Lifecycle(LifecycleNodeMixin):
    """Brings a node up."""

    def __init__(self, node: SerdNode[Any]) -> None:
        self.activity, self._node = Activity(), node
        self._activate: Activate | None = None
        self._endpoints: Endpoints | None = None
        node.at_end.callback(self._close)
        if not node.config.managed:
            self._activate = node.configure()
            self._make_activity()
            return
        # What the mixin uses of a node that derives from it.
        self.handle, self._services = node.handle, node._services
        self.default_callback_group = node.default_callback_group
        super().__init__()
        node.guard_services()
        node.get_logger().info("unconfigured: waiting for a lifecycle manager")

    def on_configure(self, _: LifecycleState) -> _Result:
        """Make what the node needs; a refusal leaves it unconfigured."""
        return self._rise("configure", self._configure, self._clean_up)

    def on_activate(self, _: LifecycleState) -> _Result:
        """Begin to work; a refusal leaves the node inactive."""
        return self._rise("activate", self._make_activity, self._drop_activity)

    def on_deactivate(self, _: LifecycleState) -> _Result:
        """End the work; after an error in it the node is unconfigured."""
        return self._fall("deactivate", self.activity.deactivate, self._drop_activity)

    def on_cleanup(self, _: LifecycleState) -> _Result:
        """Free what was configured."""
        return self._fall("cleanup", self._clean_up)

    def on_shutdown(self, _: LifecycleState) -> _Result:
        """End the work and free everything; the process goes on until a signal."""
        return self._fall("shutdown", self._close, self._clean_up)

    def on_error(self, _: LifecycleState) -> _Result:
        """Free everything, so that the node can be configured again."""
        self._clean_up()
        return _Result.SUCCESS

    def _configure(self) -> None:
        self._node.frames = Frames(getattr(self._node.config, "frame_prefix", ""))
        self._activate = self._node.configure()

    def _make_activity(self) -> None:
        assert self._activate is not None
        self._endpoints = self._node.endpoints.scope()
        self.activity = self._activate(self._endpoints)

    def _drop_activity(self) -> None:
        endpoints, self._endpoints, self.activity = self._endpoints, None, Activity()
        if endpoints is not None:
            self._node.endpoints.destroy(endpoints)

    def _clean_up(self) -> None:
        self._drop_activity()
        self._activate = None

    def _close(self) -> None:
        self.activity.close()

    def _rise(
        self, transition: str, make: Callable[[], None], take_back: Callable[[], None]
    ) -> _Result:
        result = self._result_of(transition, make)
        if result == _Result.FAILURE:
            take_back()
        return result

    def _fall(self, transition: str, *steps: Callable[[], None]) -> _Result:
        """Every step is made, whatever those before it did."""
        results = [self._result_of(transition, step) for step in steps]
        is_done = all(each == _Result.SUCCESS for each in results)
        return _Result.SUCCESS if is_done else _Result.ERROR

    def _result_of(self, transition: str, step: Callable[[], None]) -> _Result:
        try:
            step()
        except USER_ERRORS as error:
            self._node.get_logger().error(f"{transition} refused: {error}")
            return _Result.FAILURE
        except Exception as error:
            self._node.callbacks.note(transition, step, error)
            return _Result.ERROR
        return _Result.SUCCESS
