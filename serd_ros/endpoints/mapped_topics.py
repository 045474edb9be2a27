"""Topics of another robot, by a mapping file as `serd demos` takes it, as they come.

Their types are those of their publishers, so that messages are collected once all of them have one.
The time at which a message was received is that at which it was sent; of a replay by `bag_replay`
it is the log time of the bag, which that node publishes on `replayed`.
"""

from collections import defaultdict, deque
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from rclpy.subscription import Subscription

from serd_app.demonstrations.live import MappedLiveDrive
from serd_bag.errors import BagError
from serd_bag.formats.rosbag2.message_types import message_type, rosbags_types
from serd_bag.topic import RawMessage, Topic, topics_named
from serd_ros.convert.typed import REPLAYED
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.topic_types import TF_TYPE, TopicType
from serd_ros.errors import MessageError
from serd_ros.process.serd_node import Endpoints

_LOOK_PERIOD_S, _LOG_PERIOD_S = 0.1, 5.0


class MappedTopics:
    """Subscribes to the topics of a drive by a mapping; heard: called with each message."""

    def __init__(
        self, endpoints: Endpoints, drive: MappedLiveDrive, heard: Callable[[], None]
    ) -> None:
        self._node, self._endpoints = endpoints.node, endpoints
        self._drive, self._heard = drive, heard
        #: Types of the topics to take, and what was subscribed to of them.
        self._types: dict[str, str] = {}
        self._subscriptions: dict[str, Subscription] = {}
        #: Messages of a replay without their log times, and log times without their messages.
        self._waiting: defaultdict[str, deque[tuple[bytes, int]]] = defaultdict(deque)
        self._log_times: defaultdict[str, deque[int]] = defaultdict(deque)
        replayed = TopicType(REPLAYED).message
        endpoints.subscribe_raw(replayed, topics.REPLAYED, self._on_replayed, qos.LOSSLESS)
        endpoints.every(_LOOK_PERIOD_S, self._look)

    @property
    def has_publishers(self) -> bool:
        """Whether one of the topics has a publisher."""
        return any(map(self._node.count_publishers, self._types))

    @property
    def complete(self) -> bool:
        """Whether every message that was received has its time."""
        return not any(self._waiting.values())

    def _look(self) -> None:
        if not self._types and not self._begin():
            return
        for name in self._types.keys() - self._subscriptions.keys():
            found = self._node.get_publishers_info_by_topic(name)
            offered = [each.qos_profile for each in found if each.topic_type == self._types[name]]
            if offered:
                profile = qos.lossless(offered)
                kind = TopicType(self._types[name]).message
                self._subscriptions[name] = self._endpoints.subscribe_raw(
                    kind, name, partial(self._on_message, name), profile
                )

    def _begin(self) -> bool:
        """Begin to collect where all topics have publishers of one type that can be read."""
        known = self._known()
        missing = [name for name in self._drive.wanted if len(topics_named(known, name)) != 1]
        try:
            if missing:
                raise BagError(f"publishers of {', '.join(missing)}")
            self._types = {
                name: known[name].type_name for name in self._drive.begin(known) if name in known
            }
        except BagError as error:
            text = f"waiting for the topics of the mapping: {error}"
            self._node.get_logger().info(text, throttle_duration_sec=_LOG_PERIOD_S)
            return False
        self._node.get_logger().info(f"learning from {', '.join(sorted(self._types))}")
        return True

    def _known(self) -> Mapping[str, Topic]:
        """Topics that have publishers of one type, and those of /tf, which may come later."""
        found = {}
        for name, types in self._node.get_topic_names_and_types():
            if len(types) == 1 and self._node.count_publishers(name):
                try:
                    found[name] = Topic(name, message_type(types[0]))
                except BagError:
                    continue  # named where it is wanted
        for name in (topics.TF, topics.TF_STATIC):
            full = self._node.resolve_topic_name(name)
            found.setdefault(full, Topic(full, message_type(TF_TYPE)))
        return found

    def _on_message(self, name: str, data: bytes, info: Mapping[str, int]) -> None:
        self._heard()
        sent_ns = info["source_timestamp"] or info["received_timestamp"]
        if self._node.count_publishers(topics.REPLAYED):
            self._waiting[name].append((data, sent_ns))
            self._match(name)
        else:
            self._take(name, data, sent_ns)

    def _on_replayed(self, data: bytes) -> None:
        message: Any = rosbags_types().deserialize_cdr(data, REPLAYED)
        self._log_times[message.topic].extend(map(int, message.log_times))
        self._match(message.topic)

    def _match(self, name: str) -> None:
        waiting, log_times = self._waiting[name], self._log_times[name]
        while waiting and log_times:
            self._take(name, waiting.popleft()[0], log_times.popleft())

    def _take(self, name: str, data: bytes, log_time_ns: int) -> None:
        kind = self._types[name]
        try:
            self._drive.take(RawMessage(name, kind, data, log_time_ns, log_time_ns))
        except BagError as error:
            raise MessageError(f"message must be a {kind}", error, "correct it") from None
