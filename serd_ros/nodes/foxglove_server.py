"""foxglove_server: shows the topics of a running stack in Foxglove, as a ROS 2 node.

It subscribes to what has publishers and forwards messages as they come, with the definitions of
their types, by the WebSocket protocol of Foxglove; it publishes and drives nothing. It needs the
extra `foxglove` of the distribution.
"""

from collections.abc import Callable
from importlib import import_module
from typing import Any

from rclpy.qos import DurabilityPolicy

from bags.errors import BagError
from bags.formats.rosbag2.message_types import ENCODING, message_type
from serd_ros.endpoints.followed_topic import FollowedTopic, Received
from serd_ros.endpoints.topic_types import TYPES, TopicType
from serd_ros.errors import NodeError
from serd_ros.graph.configs import FoxgloveServerConfig
from serd_ros.process.serd_node import SerdNode

_LOOK_PERIOD_S = 0.5


def _sdk() -> Any:
    try:
        return import_module("foxglove")
    except ImportError as error:
        raise NodeError(
            f"foxglove_server needs the package foxglove-sdk, got {error};"
            " install it with pip install 'serd[foxglove]'"
        ) from None


class _Listener:
    """Calls back with the number of each channel that a client subscribes to."""

    def __init__(self, on_subscribe: Callable[[int], None]) -> None:
        self._on_subscribe = on_subscribe

    def on_subscribe(self, _: Any, channel: Any) -> None:
        """Called by the server, in a thread of its own."""
        self._on_subscribe(channel.id)


class FoxgloveServerNode(SerdNode[FoxgloveServerConfig]):
    """One channel per topic, of the type that its publishers have."""

    def __init__(self, kind: str) -> None:
        super().__init__(kind)
        self._sdk, config = _sdk(), self.config
        names = [each for each in config.topics if each] or list(TYPES)
        self._waiting = [self.resolve_topic_name(name) for name in names]
        self._followed: dict[str, FollowedTopic] = {}
        self._channels: dict[str, Any] = {}
        #: Last message of each latched topic by channel number, for clients that come later.
        self._latched: dict[int, tuple[Any, Received]] = {}
        self._sinks = self._sdk.Context()
        self._server = self._start(config)
        self.create_timer(_LOOK_PERIOD_S, self._look)
        self.get_logger().info(f"open ws://{config.address}:{self.port} in Foxglove")

    def _start(self, config: FoxgloveServerConfig) -> Any:
        try:
            return self._sdk.start_server(
                name="serd",
                host=config.address,
                port=config.port,
                server_listener=_Listener(self._send_latched),
                context=self._sinks,
            )
        except (OSError, RuntimeError) as error:
            raise NodeError(
                f"address and port must be free ones of this machine, got {config.address} and"
                f" {config.port} ({error}); choose another port"
            ) from None

    @property
    def port(self) -> int:
        """Where the server listens."""
        return int(self._server.port)

    def close(self) -> None:
        """End the server."""
        self._server.stop()

    def _look(self) -> None:
        """Subscribe to topics that have publishers now, and follow those of the others."""
        for followed in self._followed.values():
            followed.look()
        for name in list(self._waiting):
            types = {each.topic_type for each in self.get_publishers_info_by_topic(name)}
            if len(types) == 1:
                self._waiting.remove(name)
                self._follow(name, types.pop())

    def _follow(self, name: str, type_name: str) -> None:
        try:
            definition = message_type(type_name).text
        except BagError as error:
            self.get_logger().warning(f"{name} is not shown: {error}")
            return
        schema = self._sdk.Schema(name=type_name, encoding=ENCODING, data=definition.encode())
        self._channels[name] = self._sdk.Channel(
            name, message_encoding="cdr", schema=schema, context=self._sinks
        )
        take = self.callbacks.of_messages(name, self._take)
        self._followed[name] = FollowedTopic(self, name, TopicType(type_name), take)
        self._followed[name].look()

    def _take(self, message: Received) -> None:
        channel = self._channels[message.topic]
        offered = self._followed[message.topic].offered
        if any(each.durability == DurabilityPolicy.TRANSIENT_LOCAL for each in offered):
            self._latched[channel.id()] = channel, message
        channel.log(message.data, log_time=message.received_ns)

    def _send_latched(self, number: int) -> None:
        if number in self._latched:
            channel, message = self._latched[number]
            channel.log(message.data, log_time=message.received_ns)
