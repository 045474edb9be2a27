"""Publishers, subscriptions, services and timers of a node that live and end together.

They are rclpy's, made by its functions, and what SERD adds to them stands here: no input makes a
callback end the process (`callback_guard`), a subscription requests no more than its publishers
offer, and frames have the names by which this robot's nodes know them.
"""

import inspect
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial, wraps
from typing import TYPE_CHECKING, Any, TypeVar

from rclpy.client import Client
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from rclpy.timer import Timer

from serd_ros.endpoints.qos import common_qos, is_latched, less_demanding

if TYPE_CHECKING:
    from serd_ros.process.serd_node import SerdNode

Made = TypeVar("Made")
#: An event that waits while its endpoint is destroyed would end EventsExecutor.
_NO_PUBLISHER_EVENTS = PublisherEventCallbacks(use_default_callbacks=False)
_NO_EVENTS = SubscriptionEventCallbacks(use_default_callbacks=False)
_CONFIRMED_WITHIN_S = 0.5


class Endpoints:
    """Makes endpoints of a node; `close` destroys all that it made."""

    def __init__(self, node: "SerdNode[Any]") -> None:
        self.node = node
        self._ended = False
        #: Each with what destroys it.
        self._made: dict[Any, Callable[[Any], object]] = {}
        #: What subscribes again with another quality of service.
        self._follows: dict[Subscription, Callable[[QoSProfile], Subscription]] = {}

    def _has_ended(self) -> bool:
        return self._ended

    def _keep(self, endpoint: Made, destroy: Callable[[Any], object]) -> Made:
        self._made[endpoint] = destroy
        return endpoint

    def scope(self) -> "Endpoints":
        """Endpoints that `destroy` ends before these, and that end with these."""
        return self._keep(Endpoints(self.node), Endpoints.close)

    def publisher(self, kind: Any, topic: str, profile: QoSProfile) -> Publisher:
        """A publisher; one that lives as long as the node logs readers that request too much."""
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
        guarded = node.callbacks.of_timer(callback, self._has_ended)
        made = node.create_timer(period_s, guarded, clock=node.wall_clock, autostart=autostart)
        return self._keep(made, node.destroy_timer)

    def serve(self, kind: Any, name: str, answer: Callable[[Any], str]) -> None:
        """Serve a Trigger or SetBool.

        answer: returns the message, or raises a SerdError, the message of a response without
        success. No response is sent once its client or this service is gone (`run_node`).
        """

        def respond(request: Any, response: Any) -> Any:
            response.success, response.message = True, answer(request)
            return response

        node = self.node
        guarded = node.callbacks.of_requests(name, respond, self._has_ended)
        self._keep(node.create_service(kind, name, guarded), node.destroy_service)

    def client(self, kind: Any, name: str) -> Client:
        """The client of a service."""
        return self._keep(self.node.create_client(kind, name), self.node.destroy_client)

    def guarded(self, topic: str, callback: Callable[..., None]) -> Callable[..., None]:
        """A callback of messages that raises nothing, and does nothing after `close`."""
        return self.node.callbacks.of_messages(topic, callback, self._has_ended)

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
        profile = less_demanding(requested, common_qos(offered))
        if not offered or profile is requested:
            return [subscription]
        stays = is_latched(requested) and any(map(is_latched, offered))
        if stays and not is_latched(profile):
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

    def follow_publishers(self) -> None:
        """Request less where a publisher does not offer what a subscription requests."""
        for scope in [each for each in self._made if isinstance(each, Endpoints)]:
            scope.follow_publishers()
        for subscription, make in list(self._follows.items()):
            topic, callback = subscription.topic_name, subscription.callback
            offered = [each.qos_profile for each in self.node.get_publishers_info_by_topic(topic)]
            takes_info = len(inspect.signature(callback).parameters) == 2
            take = callback if takes_info else lambda message, _, call=callback: call(message)
            *_, newest = self.matching(subscription, offered, make, take)
            if newest is not subscription:
                self._follows.pop(subscription, None)
                self._follows[newest] = make
                profile = newest.qos_profile
                self.node.get_logger().info(
                    f"{topic}: received as its publishers offer it,"
                    f" {profile.reliability.name.lower()} and {profile.durability.name.lower()}"
                )


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
