"""What every node of the stack shares: one config, guarded callbacks, diagnostics, a clean end."""

import sys
import time
from collections.abc import Callable, Iterable, Mapping
from functools import partial, wraps
from inspect import signature
from typing import Any, Generic, TypeVar

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.service import Service
from rclpy.subscription import Subscription
from rclpy.task import Future
from rclpy.timer import Timer
from rosgraph_msgs.msg import Clock as ClockMessage

from serd_ros.convert.diagnostics import ERROR, OK, WARN, to_diagnostics
from serd_ros.convert.frames import Frames
from serd_ros.convert.stamp import Jump, stamp_ns
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.followed_topic import matching_subscriptions
from serd_ros.errors import NodeError
from serd_ros.graph.configs import NodeConfig
from serd_ros.graph.parameters import given_parameters, read_config, refusal_of
from serd_ros.process.callback_guard import CallbackGuard

Config = TypeVar("Config", bound=NodeConfig)
INTERNAL_ERROR, BAD_INPUT = 1, 2
_INPUT_REPORT_PERIOD_S = 1.0
_NO_EVENTS = SubscriptionEventCallbacks(use_default_callbacks=False)
_FOLLOW_PERIOD_S = 1.0
_CONFIRMED_WITHIN_S = 0.5


class SerdNode(Node, Generic[Config]):
    """A node with a frozen config; `finish` ends its process from inside a callback.

    kind: of CONFIGS.
    """

    def __init__(self, kind: str) -> None:
        # Before rclpy makes its own endpoints, which are guarded too.
        self.callbacks, self.frames = CallbackGuard(self, self.fail), Frames()
        self.kind = kind
        self._reported_counts = (0, 0)
        self._subscribed: dict[Subscription, Callable[[QoSProfile], Subscription]] = {}
        try:
            super().__init__(kind, automatically_declare_parameters_from_overrides=True)
        except ValueError:
            _require_values(kind, self._parameter_overrides)
            raise
        self.given = given_parameters(self)
        self.config: Config = read_config(self, kind, self.given)
        self.frames = Frames(getattr(self.config, "frame_prefix", ""))
        self.finished = Future()
        self.wall_clock = Clock(clock_type=ClockType.STEADY_TIME)
        self._diagnostics = self.create_publisher(DiagnosticArray, topics.DIAGNOSTICS, qos.STATE)
        self.create_timer(_INPUT_REPORT_PERIOD_S, self._report_input)
        self.create_timer(_FOLLOW_PERIOD_S, self._look_around)
        self._n_namesakes = 0

    def create_publisher(self, msg_type: Any, *args: Any, **options: Any) -> Publisher:
        """As rclpy's; puts the prefix of this robot's frames into what it publishes."""
        publisher = super().create_publisher(msg_type, *args, **options)
        publish = publisher.publish

        def with_prefix(message: Any) -> None:
            self.frames.add_prefix(message)
            publish(message)

        if self.frames.prefix:
            publisher.publish = with_prefix
        return publisher

    def create_subscription(
        self,
        msg_type: Any,
        topic: str,
        callback: Callable[..., None],
        profile: QoSProfile | int,
        **options: Any,
    ) -> Subscription:
        """As rclpy's, with a guarded callback; that of /clock gets sound stamps only.

        Where a publisher offers less than `profile`, the subscription requests what it offers.
        """
        if msg_type is ClockMessage and not options.get("raw"):
            callback = _of_times(callback)
        if self.frames.prefix and not options.get("raw"):
            callback = self._without_prefix(callback)
        guarded = self.callbacks.of_messages(topic, callback)
        # An event that waits while its subscription is destroyed would end EventsExecutor.
        options.setdefault("event_callbacks", _NO_EVENTS)
        make = super().create_subscription
        subscription = make(msg_type, topic, guarded, profile, **options)
        if isinstance(profile, QoSProfile) and not options.get("raw"):
            self._subscribed[subscription] = partial(make, msg_type, topic, guarded, **options)
        return subscription

    def _without_prefix(self, callback: Callable[..., None]) -> Callable[..., None]:
        """The callback of a subscription, for messages of this robot's frames."""

        @wraps(callback)
        def renamed(message: Any, *info: object) -> None:
            self.frames.remove_prefix(message)
            callback(message, *info)

        return renamed

    def destroy_subscription(self, subscription: Subscription) -> bool:
        """As rclpy's, which destroys that of /clock itself when `use_sim_time` becomes false."""
        self._subscribed.pop(subscription, None)
        return super().destroy_subscription(subscription)

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

    def serve(self, srv_type: Any, name: str, answer: Callable[[Any], str]) -> None:
        """Serve a Trigger or SetBool.

        answer: called with each request; returns the message, or raises a SerdError, whose sentence
        is the message of a response without success.
        """

        def respond(request: Any, response: Any) -> Any:
            response.success, response.message = True, answer(request)
            return response

        self.create_service(srv_type, name, respond)

    def create_timer(
        self, timer_period_sec: float, callback: Callable[[], None], *args: Any, **options: Any
    ) -> Timer:
        """As rclpy's, with a guarded callback, of steady wall time."""
        guarded = self.callbacks.of_timer(callback)
        options.setdefault("clock", self.wall_clock)
        return super().create_timer(timer_period_sec, guarded, *args, **options)

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """As rclpy's, which the services call; to set a fixed parameter is refused with the fix."""
        reason = refusal_of(parameter_list, type(self.config))
        if reason:
            return SetParametersResult(successful=False, reason=reason)
        return super().set_parameters_atomically(parameter_list)

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

    def confirm(self, publishers: Iterable[Publisher]) -> None:
        """Wait until what they published last has arrived, _CONFIRMED_WITHIN_S in all.

        Subscribers drop what they have not taken yet when they learn that its publisher ended.
        """
        end_s = time.monotonic() + _CONFIRMED_WITHIN_S
        for each in publishers:
            left_s = max(0.0, end_s - time.monotonic())
            each.wait_for_all_acked(Duration(seconds=left_s))

    def report(
        self,
        time_s: float,
        values: Mapping[str, object],
        *,
        level: bytes = OK,
        message: str = "",
        part: str = "",
    ) -> None:
        """Publish the node's health and numbers on `diagnostics`, whatever its name is.

        part: what has a status of its own, `NODE: PART`.
        """
        name = f"{self.kind}: {part}" if part else self.kind
        status = to_diagnostics(name, time_s, values, level=level, message=message)
        self._diagnostics.publish(status)

    def _look_around(self) -> None:
        self._follow_publishers()
        self._warn_of_namesakes()

    def _warn_of_namesakes(self) -> None:
        """Log when another node of this name appears: services and parameters reach either."""
        own = self.get_name(), self.get_namespace()
        n_namesakes = self.get_node_names_and_namespaces().count(own) - 1
        if n_namesakes > self._n_namesakes:
            self.get_logger().warning(
                f"{n_namesakes + 1} nodes are named {self.get_fully_qualified_name()}, of which"
                " services and parameters reach any; end all but one, or start them with other"
                " names or namespaces (one that was killed remains for 20 s)"
            )
        self._n_namesakes = n_namesakes

    def _follow_publishers(self) -> None:
        """Request less where a publisher does not offer what a subscription requests."""
        for subscription, make in list(self._subscribed.items()):
            topic = subscription.topic_name
            found = self.get_publishers_info_by_topic(topic)
            offered = [each.qos_profile for each in found]
            *_, newest = matching_subscriptions(
                self, subscription, offered, make, _with_info(subscription.callback)
            )
            if newest is not subscription:
                self._subscribed.pop(subscription, None)
                self._subscribed[newest] = make
                profile = newest.qos_profile
                self.get_logger().info(
                    f"{topic}: received as its publishers offer it,"
                    f" {profile.reliability.name.lower()} and {profile.durability.name.lower()}"
                )

    def _report_input(self) -> None:
        """Publish what was dropped when it has changed, as a status of its own."""
        counts = self.callbacks.n_rejected, self.callbacks.n_internal_errors
        if counts != self._reported_counts:
            self._reported_counts = counts
            level = ERROR if self.callbacks.n_internal_errors else WARN
            values = self.callbacks.values()
            self.report(0.0, values, level=level, message="input dropped", part="input")

    def wall_s(self) -> float:
        """Steady wall time, independent of /clock."""
        return time.monotonic()


def _require_values(kind: str, given: Mapping[str, Parameter]) -> None:
    """Refuse parameters without a value, which ROS makes of empty lists."""
    names = [name for name, each in given.items() if each.type_ is Parameter.Type.NOT_SET]
    if names:
        raise NodeError(
            f"parameter of {kind}: {', '.join(names)} must have a value, got none; leave it out"
        )


def _with_info(callback: Callable[..., None]) -> Callable[..., None]:
    """The callback of a subscription, to be called with a message and its info."""
    takes_info = len(signature(callback).parameters) == 2
    return callback if takes_info else lambda message, _: callback(message)


def _of_times(callback: Callable[[ClockMessage], None]) -> Callable[[ClockMessage], None]:
    """The callback of /clock for stamps that are times, since rclpy checks none."""

    def checked(message: ClockMessage) -> None:
        stamp_ns(message.clock)
        callback(message)

    return checked
