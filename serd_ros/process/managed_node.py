"""A node that a lifecycle manager can bring up, where its parameter `managed` is true.

States and transitions are those of https://design.ros2.org/articles/node_lifecycle.html. Without
`managed` the node configures and activates itself at its start, and has no lifecycle services.

Its parameters can be set while it is unconfigured. An error of the project refuses a transition
with its sentence, in the log and as status `NODE: lifecycle`; any other exception is an internal
error, after which the node is unconfigured.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

from rcl_interfaces.msg import SetParametersResult
from rclpy.action import ActionClient
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.lifecycle.node import LifecycleNodeMixin, LifecycleState, TransitionCallbackReturn
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.service import Service

from serd_files.errors import USER_ERRORS
from serd_ros.convert.diagnostics import ERROR, OK
from serd_ros.errors import NodeError
from serd_ros.graph.configs import ManagedConfig
from serd_ros.graph.parameters import plain, validated
from serd_ros.process.callback_guard import Lifetime
from serd_ros.process.serd_node import SerdNode

Config = TypeVar("Config", bound=ManagedConfig)
Step = Callable[[], None]
_MANAGED = "managed"
_STATE_AFTER = {
    "configure": "inactive",
    "activate": "active",
    "deactivate": "inactive",
    "cleanup": "unconfigured",
    "shutdown": "finalized",
}
_DONE, _REFUSED, _FAILED = (
    TransitionCallbackReturn.SUCCESS,
    TransitionCallbackReturn.FAILURE,
    TransitionCallbackReturn.ERROR,
)


class ManagedNode(SerdNode[Config], LifecycleNodeMixin):
    """Deactivation destroys the endpoints that `activate` made; cleanup those of `configure`, and
    deletes the attributes that both set. Action clients stay."""

    def __init__(self, kind: str) -> None:
        self._action_clients: dict[str, ActionClient] = {}
        super().__init__(kind)
        self.state = "active"
        #: For each transition upwards, the endpoints there were before it and their lifetime.
        self._before: list[tuple[set[Any], Lifetime]] = []
        self._attributes: frozenset[str] = frozenset()
        if not self.config.managed:
            self.configure()
            self.activate()
            return
        LifecycleNodeMixin.__init__(self)
        for service in self.services:
            if service.srv_type.__module__.startswith("lifecycle_msgs."):
                # An impossible transition raises, which would end the process.
                service.callback = self.callbacks.of_requests(service.srv_name, service.callback)
        self._enter("unconfigured")
        self.get_logger().info("unconfigured: waiting for a lifecycle manager")

    def configure(self) -> None:
        """Read and check files, and make what needs no topics."""

    def activate(self) -> None:
        """Make endpoints and begin to work."""

    def release(self) -> None:
        """End the work of an active node that is deactivated or whose process ends."""

    def deactivate(self) -> None:
        """End the work of an active node whose process goes on."""
        self.release()

    def close(self) -> None:
        """As `release`, where there is something to release."""
        if self.state == "active":
            self.release()

    def create_publisher(self, msg_type: Any, *args: Any, **options: Any) -> Publisher:
        """As SerdNode's, without events, as its subscriptions."""
        no_events = PublisherEventCallbacks(use_default_callbacks=False)
        options.setdefault("event_callbacks", no_events)
        return super().create_publisher(msg_type, *args, **options)

    def action_client(self, kind: Any, name: str) -> ActionClient:
        """The client of an action, made once and kept while the process lives.

        The events executor drops what it keeps of an action client without Python's lock: where
        one is destroyed while a message waits for it, the process ends by a segmentation fault.
        """
        if name not in self._action_clients:
            self._action_clients[name] = ActionClient(self, kind, name)
        return self._action_clients[name]

    def create_service(self, *args: Any, **options: Any) -> Service:
        """As SerdNode's; a request that waits while its service is destroyed gets no response."""
        service, lifetime = super().create_service(*args, **options), self.callbacks.lifetime
        send = service.send_response

        def send_unless_ended(response: Any, header: Any) -> None:
            if not lifetime.ended:
                send(response, header)

        service.send_response = send_unless_ended
        return service

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """As SerdNode's; in state unconfigured all parameters but `managed` can be set."""
        fields = type(self.config).model_fields
        own = {each.name: plain(each.value) for each in parameter_list if each.name in fields}
        if own and self.state in ("inactive", "finalized"):
            reason = f"{', '.join(own)} cannot be set while the node is {self.state}; clean it up"
            return SetParametersResult(successful=False, reason=reason)
        if own and self.state == "unconfigured" and _MANAGED not in own:
            others = [each for each in parameter_list if each.name not in own]
            return self._choose({**self.given, **own}, others)
        result = super().set_parameters_atomically(parameter_list)
        if result.successful:
            self.given |= own
        return result

    def _choose(
        self, given: Mapping[str, Any], others: Sequence[Parameter] = ()
    ) -> SetParametersResult:
        """Set what is given, those whose defaults depend on it, and parameters of rclpy."""
        try:
            config = validated(self.kind, given, type(self.config))
        except USER_ERRORS as error:
            return SetParametersResult(successful=False, reason=str(error))
        changed = [
            Parameter(name, value=plain(getattr(config, name)))
            for name in type(config).model_fields
            if getattr(config, name) != getattr(self.config, name)
        ]
        result = Node.set_parameters_atomically(self, [*others, *changed])
        if result.successful:
            self.given, self.config = dict(given), config
        return result

    def on_configure(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Make what the node needs; a refusal leaves it unconfigured."""
        self._attributes = frozenset(vars(self))
        return self._rise("configure", self._configure, self._clean_up)

    def on_activate(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Begin to work; a refusal leaves the node inactive."""
        return self._rise("activate", self.activate, self._destroy_newest)

    def on_deactivate(self, _: LifecycleState) -> TransitionCallbackReturn:
        """End the work; after an error in it the node is unconfigured."""
        return self._fall("deactivate", self.deactivate, self._destroy_newest)

    def on_cleanup(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Free what was configured."""
        return self._fall("cleanup", self._clean_up)

    def on_shutdown(self, _: LifecycleState) -> TransitionCallbackReturn:
        """End the work and free everything; the process goes on until a signal."""
        return self._fall("shutdown", self.close, self._clean_up)

    def on_error(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Free everything, so that the node can be configured again."""
        self._clean_up()
        self._enter("unconfigured", report=False)
        return _DONE

    def _configure(self) -> None:
        """A file may have changed on which defaults depend, as may a parameter have."""
        result = self._choose(self.given)
        if not result.successful:
            raise NodeError(result.reason)
        self.configure()

    def _rise(self, transition: str, make: Step, take_back: Step) -> TransitionCallbackReturn:
        endpoints = {endpoint for endpoint, _ in self._endpoints()}
        self._before.append((endpoints, self.callbacks.lifetime))
        self.callbacks.lifetime = Lifetime()
        result = self._result_of(transition, make)
        if result == _REFUSED:
            take_back()
        elif result == _DONE:
            self._enter(_STATE_AFTER[transition])
        return result

    def _fall(self, transition: str, *steps: Step) -> TransitionCallbackReturn:
        """Every step is made, whatever those before it did."""
        results = [self._result_of(transition, step) for step in steps]
        if any(each != _DONE for each in results):
            return _FAILED
        self._enter(_STATE_AFTER[transition])
        return _DONE

    def _result_of(self, transition: str, step: Step) -> TransitionCallbackReturn:
        try:
            step()
        except USER_ERRORS as error:
            self.get_logger().error(f"{transition} refused: {error}")
            self._report_state(ERROR, f"{transition} refused: {error}")
            return _REFUSED
        except Exception as error:
            self.callbacks.note(transition, step, error)
            self._report_state(ERROR, f"{transition} failed: {error}")
            return _FAILED
        return _DONE

    def _enter(self, state: str, *, report: bool = True) -> None:
        self.state = state
        changeable = type(self.config).changeable
        for name in type(self.config).model_fields:
            is_free = state == "unconfigured" and name != _MANAGED
            self.describe_parameter(name).read_only = not is_free and name not in changeable
        if report:
            self._report_state(OK, "")

    def _report_state(self, level: bytes, message: str) -> None:
        self.report(0.0, {"state": self.state}, level=level, message=message, part="lifecycle")

    def _endpoints(self) -> list[tuple[Any, Callable[[Any], object]]]:
        """Each with what destroys it."""
        kinds = (
            (self.timers, self.destroy_timer),
            (self.subscriptions, self.destroy_subscription),
            (self.services, self.destroy_service),
            (self.clients, self.destroy_client),
            (self.publishers, self.destroy_publisher),
        )
        return [(each, destroy) for endpoints, destroy in kinds for each in endpoints]

    def _destroy_newest(self) -> None:
        """Destroy the endpoints that the last transition upwards made."""
        self.callbacks.lifetime.ended = True
        before, self.callbacks.lifetime = self._before.pop()
        self.confirm(each for each in self.publishers if each not in before)
        for endpoint, destroy in self._endpoints():
            if endpoint not in before:
                destroy(endpoint)

    def _clean_up(self) -> None:
        while self._before:
            self._destroy_newest()
        if self._attributes:
            for name in set(vars(self)) - self._attributes:
                delattr(self, name)
