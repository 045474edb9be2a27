"""What every node of the stack has: one config, endpoints, a clean end, health on `diagnostics`.

Publishers, subscriptions, services and timers are rclpy's, made by its functions, and live and end
together. What SERD adds to them stands here: no input makes a callback end the process
(`callback_guard`), a subscription requests no more than its publishers offer, and frames have the
names by which this robot's nodes know them.
"""

import inspect
import json
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from functools import partial, wraps
from typing import Any, ClassVar, Generic, TypeVar

from diagnostic_msgs.msg import DiagnosticArray
from pydantic import ValidationError
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.client import Client
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from rclpy.task import Future
from rclpy.timer import Timer
from rosgraph_msgs.msg import Clock as ClockMessage

from serd_files.errors import USER_ERRORS
from serd_files.moved_names import where_or_near
from serd_files.settings import settings_of
from serd_files.yaml_config import sentence_of
from serd_ros.convert.diagnostics import ERROR, OK, WARN, to_diagnostics
from serd_ros.convert.frames import Frames
from serd_ros.convert.stamp import stamp_ns
from serd_ros.endpoints import qos, topics
from serd_ros.errors import NodeError
from serd_ros.process.callback_guard import CallbackGuard
from serd_ros.settings import Config

INTERNAL_ERROR, BAD_INPUT = 1, 2
_LOOK_PERIOD_S = 1.0
Made = TypeVar("Made")
#: An event that waits while its endpoint is destroyed would end EventsExecutor.
_NO_PUBLISHER_EVENTS = PublisherEventCallbacks(use_default_callbacks=False)
_NO_EVENTS = SubscriptionEventCallbacks(use_default_callbacks=False)
_CONFIRMED_WITHIN_S = 0.5


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
        self.add_on_set_parameters_callback(self._may_set)
        self.add_post_set_parameters_callback(self._take_set)

    def configure(self) -> "Activate":
        """Read and check what a managed node needs; calling what it returns begins the work."""
        raise NotImplementedError

    def check_change(self, config: Config) -> None:
        """Raise a SerdError where the node may not go on with this config, which is valid."""

    def take_change(self, config: Config) -> None:
        """Go on with this config, which `check_change` has passed; `self.config` is it already."""

    def _may_set(self, parameters: Sequence[Parameter]) -> SetParametersResult:
        try:
            self.check_change(self._changed(parameters))
        except USER_ERRORS as error:
            self.get_logger().warning(f"refused: {error}")
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _take_set(self, parameters: Sequence[Parameter]) -> None:
        self._guard_clock()
        before, self.config = self.config, self._changed(parameters)
        for name in (each.name for each in parameters if each.name in type(before).model_fields):
            was, now = getattr(before, name), getattr(self.config, name)
            self.get_logger().info(f"{name} was {was}, is {now}")
        if self.config != before:
            self.take_change(self.config)

    def _changed(self, parameters: Sequence[Parameter]) -> Config:
        """The config with parameters that are set; NodeError where one is fixed, or wrong."""
        live = {each.name: each.live for each in settings_of(type(self.config))}
        given = {each.name: plain(each.value) for each in parameters if each.name in live}
        for name in given:
            if not live[name]:
                raise NodeError(
                    f"{name} is fixed while {self.kind} runs; end the node and start it with"
                    f" -p {name}:=VALUE"
                )
        values = {name: plain(value) for name, value in self.config.model_dump().items()}
        return validated(self.kind, values | given, type(self.config)) if given else self.config

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


class Endpoints:
    """Makes endpoints of a node; `close` destroys all that it made."""

    def __init__(self, node: SerdNode[Any]) -> None:
        self.node = node
        self._ended = False
        #: Each with what destroys it.
        self._made: dict[Any, Callable[[Any], object]] = {}
        #: What subscribes again with another quality of service.
        self._follows: dict[Subscription, Callable[[QoSProfile], Subscription]] = {}

    def _until_closed(self, guarded: Callable[..., Any]) -> Callable[..., Any]:
        """The callback; after `close` it does nothing, and the one of a service responds empty.

        The executor still calls what was due when its endpoint was destroyed.
        """

        @wraps(guarded)
        def called(*arguments: Any) -> Any:
            if self._ended:
                return arguments and arguments[-1]  # of a service: its response
            return guarded(*arguments)

        return called

    def _keep(self, endpoint: Made, destroy: Callable[[Any], object]) -> Made:
        self._made[endpoint] = destroy
        return endpoint

    def scope(self) -> "Endpoints":
        """Endpoints that `destroy` ends before these, and that end with these."""
        return self._keep(Endpoints(self.node), Endpoints.close)

    def publisher(self, kind: Any, topic: str, profile: QoSProfile) -> Publisher:
        """A publisher; outside of scopes it logs subscriptions that request more than it offers."""
        node = self.node
        events = None if self is node.endpoints else _NO_PUBLISHER_EVENTS
        made = node.create_publisher(kind, topic, profile, event_callbacks=events)
        return self._keep(made, node.destroy_publisher)

    def subscribe(
        self, kind: Any, topic: str, callback: Callable[..., None], profile: QoSProfile
    ) -> None:
        """Call back with each message, also where a publisher offers less than `profile`."""
        if self.node.frames.prefix:
            callback = self._without_prefix(callback)
        make = partial(self._subscription, kind, topic, self.guarded(topic, callback))
        self._follows[make(profile)] = make

    def subscribe_raw(
        self, kind: Any, topic: str, callback: Callable[..., None], profile: QoSProfile
    ) -> Subscription:
        """A subscription that calls back with bytes; it requests `profile` whatever is offered."""
        return self._subscription(kind, topic, self.guarded(topic, callback), profile, raw=True)

    def _subscription(
        self, kind: Any, topic: str, guarded: Callable[..., None], profile: QoSProfile, **raw: bool
    ) -> Subscription:
        made = self.node.create_subscription(
            kind, topic, guarded, profile, event_callbacks=_NO_EVENTS, **raw
        )
        return self._keep(made, self.node.destroy_subscription)

    def _without_prefix(self, callback: Callable[..., None]) -> Callable[..., None]:
        @wraps(callback)
        def renamed(message: Any, *info: object) -> None:
            self.node.frames.remove_prefix(message)
            callback(message, *info)

        return renamed

    def every(
        self, period_s: float, callback: Callable[[], None], *, autostart: bool = True
    ) -> Timer:
        """A timer of steady wall time."""
        node = self.node
        guarded = self._until_closed(node.callbacks.of_timer(callback))
        made = node.create_timer(period_s, guarded, clock=node.wall_clock, autostart=autostart)
        return self._keep(made, node.destroy_timer)

    def serve(self, kind: Any, name: str, answer: Callable[[Any], str]) -> None:
        """Serve a Trigger or SetBool.

        answer: returns the message, or raises a SerdError, the message of a response without
        success. No response is sent once its client or this service is gone (`run_node`).
        """

        def respond(request: Any, response: Any) -> None:
            response.success, response.message = True, answer(request)

        self.answer(kind, name, respond)

    def answer(self, kind: Any, name: str, fill: Callable[[Any, Any], None]) -> None:
        """Serve any type. fill: fills the response, which is the type's own where it raises."""

        def respond(request: Any, response: Any) -> Any:
            fill(request, response)
            return response

        node = self.node
        guarded = self._until_closed(node.callbacks.of_requests(name, respond))
        self._keep(node.create_service(kind, name, guarded), node.destroy_service)

    def client(self, kind: Any, name: str) -> Client:
        """The client of a service."""
        return self._keep(self.node.create_client(kind, name), self.node.destroy_client)

    def guarded(self, topic: str, callback: Callable[..., None]) -> Callable[..., None]:
        """A callback of messages that raises nothing, and does nothing after `close`."""
        return self._until_closed(self.node.callbacks.of_messages(topic, callback))

    def destroy(self, endpoint: Any) -> None:
        """Destroy an endpoint or a scope before the others."""
        self._follows.pop(endpoint, None)
        self._made.pop(endpoint)(endpoint)

    def close(self) -> None:
        """Destroy all, once what was published has arrived."""
        self._ended = True
        confirm(each for each in self._made if isinstance(each, Publisher))
        while self._made:
            self.destroy(next(reversed(self._made)))

    def matching(
        self,
        subscription: Subscription,
        offered: Sequence[QoSProfile],
        make: Callable[[QoSProfile], Subscription],
        take: Callable[[Any, Mapping[str, int]], None],
    ) -> list[Subscription]:
        """The subscription, or what matches all publishers in its place, the one to follow last.

        A latched one stays where some publishers are volatile, with a volatile one beside it; any
        other is replaced. take: called with each message that waits in it then, and its info.
        """
        requested = subscription.qos_profile
        profile = qos.less_demanding(requested, qos.common_qos(offered))
        if not offered or profile is requested:
            return [subscription]
        stays = qos.is_latched(requested) and any(map(qos.is_latched, offered))
        if stays and not qos.is_latched(profile):
            return [subscription, make(profile)]
        self.end(subscription, take)
        return [make(profile)]

    def end(
        self, subscription: Subscription, take: Callable[[Any, Mapping[str, int]], None]
    ) -> None:
        """Destroy a subscription, once `take` was called with each message that waits in it."""
        for message, info in waiting_messages(subscription):
            take(message, info)
        self.destroy(subscription)

    def take_waiting(self) -> None:
        """Call back with each message that has arrived and waits for its turn.

        What judges how old its inputs are calls this first: to a process that had to wait for a
        processor, messages that have arrived in time would seem not to have come.
        """
        for each in list(self._made):
            if isinstance(each, Endpoints):
                each.take_waiting()
            elif isinstance(each, Subscription):
                for message, info in waiting_messages(each):
                    _with_info(each.callback)(message, info)

    def follow_publishers(self) -> None:
        """Request less where a publisher does not offer what a subscription requests."""
        for scope in [each for each in self._made if isinstance(each, Endpoints)]:
            scope.follow_publishers()
        for subscription, make in list(self._follows.items()):
            topic, callback = subscription.topic_name, subscription.callback
            offered = [each.qos_profile for each in self.node.get_publishers_info_by_topic(topic)]
            *_, newest = self.matching(subscription, offered, make, _with_info(callback))
            if newest is not subscription:
                self._follows.pop(subscription, None)
                self._follows[newest] = make
                profile = newest.qos_profile
                self.node.get_logger().info(
                    f"{topic}: received as its publishers offer it,"
                    f" {profile.reliability.name.lower()} and {profile.durability.name.lower()}"
                )


def _with_info(callback: Callable[..., None]) -> Callable[[Any, Mapping[str, int]], None]:
    """A callback of messages as one that takes their info too."""
    takes_info = len(inspect.signature(callback).parameters) == 2
    return callback if takes_info else lambda message, _: callback(message)


def confirm(publishers: Iterable[Publisher]) -> None:
    """Wait for 0.5 s in all until the last messages have arrived, which else may be dropped."""
    end_s = time.monotonic() + _CONFIRMED_WITHIN_S
    for each in publishers:
        each.wait_for_all_acked(Duration(seconds=max(0.0, end_s - time.monotonic())))


def waiting_messages(subscription: Subscription) -> Iterator[tuple[Any, Mapping[str, int]]]:
    """The messages that wait, with their info; works until the node is destroyed."""
    raw = bool(subscription.raw)
    while (found := subscription.handle.take_message(subscription.msg_type, raw)) is not None:
        yield bytes(found[0]) if raw else found[0], found[1]


class Activity:
    """The work of an active node: made at its activation, dropped at its deactivation."""

    def deactivate(self) -> None:
        """End the work; the process goes on, and the endpoints are destroyed afterwards."""
        self.close()

    def close(self) -> None:
        """End the work; the process ends."""


#: Makes endpoints and begins to work.
Activate = Callable[[Endpoints], Activity]

ROS_OWN = ("use_sim_time", "start_type_description_service", "qos_overrides")


def declare(node: Node, kind: str, config_class: type[Config]) -> Config:
    """Declare each parameter of a node once; NodeError for a bad name or value."""
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
                description=each.description,
                additional_constraints="; ".join(
                    filter(None, (each.range, "" if each.live else "fixed while the node runs"))
                ),
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
