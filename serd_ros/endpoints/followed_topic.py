"""Topics of which type or quality of service is that of their publishers; /tf, and people.

A subscription matches a publisher when it requests no more than is offered: reliability, and
messages from before it was made (transient local). So it requests what all publishers offer; where
only some are latched, it first receives what these have kept.

The middleware has one type per topic and process: until a publisher of another known type comes,
people are received as `pedestrians`, a PointCloud2. Other types and transforms travel as bytes,
so that their packages need not be installed: there is no wheel of tf2_msgs.
"""

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any
from zlib import crc32

import numpy as np
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.event_handler import EventHandler, QoSSubscriptionEventType
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from sensor_msgs.msg import PointCloud2

from serd_app.drives.people import CLOUD, SeenPeople, SightedIds, people_in, require_people
from serd_app.drives.transforms import plain_name
from serd_bag.errors import BagError
from serd_bag.formats.rosbag2.message_types import message_type, rosbags_types
from serd_bag.messages.plain import Transform, transforms
from serd_bag.topic import MessageType, Topic
from serd_ros.convert.frames import Frames, NotYetError
from serd_ros.convert.motion import PlanarPose, odom_in_map, to_quaternion
from serd_ros.convert.sensors import from_people_message
from serd_ros.convert.stamp import require_finite, require_time, to_stamp
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.qos import common_qos, is_latched, recording_qos
from serd_ros.endpoints.topic_types import HASH_START, TF_TYPE, TopicType
from serd_ros.errors import MessageError
from serd_ros.process.serd_node import Endpoints, waiting_messages
from serd_sim.perception.scan_people import PeopleTracker
from serd_sim.robot.urdf import LinkTransform, Placed
from serd_sim.world.observation import People

_LOOK_PERIOD_S, _LOG_PERIOD_S = 0.5, 5.0
#: A message waits so long (s) for the transforms of its stamp.
_WAITS_S = 1.0


@dataclass(frozen=True)
class Received:
    """A raw message; the times are by the clocks of this machine and of its publisher, else 0."""

    topic: str
    data: bytes
    received_ns: int
    sent_ns: int


class FollowedTopic:
    """Subscribes at once where the type has a profile, else as soon as there is a publisher.

    name: in full; take: called with each message; topic: by which bad ones are counted, the name
    when empty; offered: by the publishers there were when it subscribed; n_lost: messages that the
    middleware did not deliver, by the numbers that a publisher gives where there is only one, else
    those that the middleware reports, which are lost on the way and not in a full queue.
    """

    def __init__(
        self,
        endpoints: Endpoints,
        name: str,
        kind: TopicType,
        take: Callable[[Received], None],
        topic: str = "",
    ) -> None:
        self.name, self.kind, self.stamped = name, kind, kind.stamped
        self.offered: tuple[QoSProfile, ...] = ()
        self.n_lost, self._last, self._has_one = 0, 0, False
        self._others: list[str] = []
        self._reported: LostMessages | None = None
        self._endpoints, self.take = endpoints, endpoints.guarded(topic or name, take)
        self._subscription: Subscription | None = None
        if kind.qos is not None:
            self.offered = (kind.qos,)
            self._subscription = self._subscribe(recording_qos(kind.qos))

    @property
    def is_subscribed(self) -> bool:
        """Whether there is a subscription."""
        return self._subscription is not None

    def look(self) -> bool:
        """Follow the publishers; whether it subscribed just now."""
        found = self._endpoints.node.get_publishers_info_by_topic(self.name)
        self._has_one = len(found) == 1
        offered = [each.qos_profile for each in found if each.topic_type == self.kind.name]
        self._others = [] if offered else sorted({each.topic_type for each in found})
        self._take_reported(several=len(found) > 1)
        if not offered:
            return False
        if self._subscription is None:
            self.offered = tuple(offered)
            latched = [each for each in offered if is_latched(each)]
            self._subscription = self._subscribe(common_qos(latched or offered))
            return True
        *latched, self._subscription = self._endpoints.matching(
            self._subscription, offered, self._subscribe, self._take_received
        )
        for each in latched:  # what it has kept has come
            self._endpoints.end(each, self._take_received)
            self._last = 0  # two subscriptions have counted
        return False

    def _take_reported(self, *, several: bool) -> None:
        subscription, reported = self._subscription, self._reported
        if subscription is None or not (several or reported):
            return
        if reported is None or reported.subscription is not subscription:
            self._reported = LostMessages(subscription)
        elif (n_lost := reported.take()) and several:
            self.n_lost += n_lost

    @property
    def silence(self) -> str:
        """Which messages do not arrive, and why, as far as is known, else empty."""
        if self.n_lost:
            return f"{self.n_lost} messages of {self.name} were lost on the way"
        if self._others:
            return f"{self.name} is {', '.join(self._others)}, not {self.kind.name}"
        return "" if self.is_subscribed else f"{self.name} has no publisher"

    def waiting(self) -> Iterator[Received]:
        """Messages that were received and not taken yet."""
        if self._subscription is not None:
            for data, info in waiting_messages(self._subscription):
                yield self._received(data, info)

    def _take_received(self, data: bytes, info: Mapping[str, int]) -> None:
        self.take(self._received(data, info))

    def _received(self, data: bytes, info: Mapping[str, int]) -> Received:
        number = info.get("publication_sequence_number") or 0
        if self._has_one and 0 < self._last < number:
            self.n_lost += number - self._last - 1
        self._last = number if self._has_one else 0
        received_ns = max(info["received_timestamp"], 0) or time.time_ns()
        return Received(self.name, data, received_ns, info["source_timestamp"])

    def _subscribe(self, profile: QoSProfile) -> Subscription:
        return self._endpoints.subscribe_raw(
            self.kind.message, self.name, self._take_received, profile
        )


class LostMessages(EventHandler):
    """Counts what the middleware reports as lost to a subscription, from now on.

    It is asked and not called back: an event that waits in EventsExecutor when its subscription is
    destroyed would end that.
    """

    def __init__(self, subscription: Subscription) -> None:
        super().__init__(
            callback_group=ReentrantCallbackGroup(),
            callback=None,
            event_type=QoSSubscriptionEventType.RCL_SUBSCRIPTION_MESSAGE_LOST,
            parent_impl=subscription.handle,
        )
        self.subscription = subscription
        self.take()

    def take(self) -> int:
        """How many since the last time."""
        self._ready_to_take_data = True
        return int(self.take_data().total_count_change)


def follow_transforms(endpoints: Endpoints, on_change: Callable[[], None] = lambda: None) -> None:
    """Keep the frames of the node as /tf is; on_change: called after each message of /tf."""
    node = endpoints.node

    def take(message: Received, *, static: bool) -> None:
        try:
            found = transforms(message.data, TF_TYPE, rosbags_types())
        except BagError as error:
            raise MessageError(f"message must be a {TF_TYPE}", error, "correct it") from None
        faults = [_fault_of(node.frames, each, static=static) for each in found]
        if not static:
            on_change()
        waiting = list(node.frames.waiting)
        node.frames.waiting.clear()
        for again in waiting:
            again()
        for fault in filter(None, faults):
            raise fault

    followed = [
        FollowedTopic(
            endpoints,
            node.resolve_topic_name(name),
            TopicType(TF_TYPE),
            partial(take, static=name == topics.TF_STATIC),
            name,
        )
        for name in (topics.TF, topics.TF_STATIC)
    ]

    def look() -> None:
        for each in followed:
            each.look()

    endpoints.every(_LOOK_PERIOD_S, look)


def when_placed(
    endpoints: Endpoints, take: Callable[[Any], None], topic: str
) -> Callable[..., None]:
    """A callback of messages that may come before the transforms of their stamp.

    Such a message is taken again after the next transforms, for a second. topic: by which those
    are counted that /tf never reaches.
    """
    node = endpoints.node

    def taken(message: Any, since_s: float) -> None:
        try:
            take(message)
        except NotYetError:
            if node.wall_s() - since_s > _WAITS_S:
                raise
            node.frames.waiting.append(partial(again, message, since_s))

    again = endpoints.guarded(topic, taken)
    return lambda message: taken(message, node.wall_s())


def _fault_of(frames: Frames, transform: Transform, *, static: bool) -> MessageError | None:
    """Take a transform, or say why it is none."""
    try:
        frames.take(transform, static=static)
    except MessageError as error:
        return error
    return None


class TransformPublisher:
    """Publishes map -> odom -> base_link on `tf` while there are subscribers."""

    def __init__(self, endpoints: Endpoints) -> None:
        self._frames = endpoints.node.frames
        self._tf = endpoints.publisher(TopicType(TF_TYPE).message, topics.TF, qos.TF)

    def publish(self, base_in_map: PlanarPose, base_in_odom: PlanarPose, time_s: float) -> None:
        """Send both transforms."""
        if not self._tf.get_subscription_count():
            return
        odom = odom_in_map(base_in_map, base_in_odom)
        message = _message(
            time_s,
            (topics.MAP_FRAME, topics.ODOM_FRAME, _level(odom)),
            (topics.ODOM_FRAME, topics.BASE_FRAME, _level(base_in_odom)),
        )
        self._tf.publish(_encoded(self._frames.prefixed(message)))


def publish_links(endpoints: Endpoints, links: Iterable[LinkTransform]) -> None:
    """Publish where the links of a robot are on `tf_static`, with the node's prefix, once."""
    prefix = endpoints.node.frames.prefix
    prefixed = ((prefix + parent, prefix + child, placed) for parent, child, placed in links)
    message = _message(0.0, *prefixed)
    publisher = endpoints.publisher(TopicType(TF_TYPE).message, topics.TF_STATIC, qos.LATCHED)
    publisher.publish(_encoded(message))


def _encoded(message: Any) -> bytes:
    return bytes(rosbags_types().serialize_cdr(message, TF_TYPE))


def _level(pose: PlanarPose) -> Placed:
    """A pose on the floor, in space."""
    turned = to_quaternion(pose[2])
    return (*pose[:2], 0.0), (turned.x, turned.y, turned.z, turned.w)


def _message(time_s: float, *links: LinkTransform) -> Any:
    """A TFMessage of rosbags, which encodes it without the package."""
    types, stamp = rosbags_types().types, to_stamp(time_s)
    at = types["builtin_interfaces/msg/Time"](stamp.sec, stamp.nanosec)

    def made(name: str, *fields: Any) -> Any:
        return types[f"geometry_msgs/msg/{name}"](*fields)

    stamped = []
    for parent, child, (moved, turned) in links:
        place, turn = made("Vector3", *map(float, moved)), made("Quaternion", *map(float, turned))
        header = types["std_msgs/msg/Header"](at, parent)
        stamped.append(made("TransformStamped", header, child, made("Transform", place, turn)))
    return types[TF_TYPE](stamped)


class PeopleInMap:
    """Converts the people of one topic, message by message.

    A type without velocities gets those of its ids, 0 for an id that is new; without ids too, its
    people are tracked as those in scans are.
    """

    def __init__(self) -> None:
        self._ids, self._tracker, self._last_ns = SightedIds(), PeopleTracker(), 0

    def convert(self, seen: SeenPeople, frames: Frames) -> tuple[int, People]:
        """(stamp_ns, people in the map); MessageError for a stamp, frame or number that is none."""
        time_ns = require_time(seen.header.stamp_ns)
        require_finite("positions", seen.position_m)
        # The types that have no velocities give NaN in all three coordinates.
        require_finite("velocities", seen.velocity_mps[~np.isnan(seen.velocity_mps).all(axis=1)])
        placed = _in_map(seen, frames)
        if time_ns < self._last_ns:
            self._tracker.reset()
        self._last_ns = time_ns
        without_velocities = np.isnan(placed.velocity_mps).any()
        # An empty message has no type of people by which to choose: tracks go on until they end.
        goes_on = not len(placed.position_m) and len(self._tracker.identity)
        if not any(placed.ids) and (without_velocities or goes_on):
            tracker = self._tracker
            tracker.update(placed.position_m[:, :2], time_ns * 1e-9)
            return time_ns, People(tracker.position_m, tracker.velocity_mps, tracker.identity)
        placed = self._ids.with_velocities(placed, time_ns * 1e-9)
        numbers = [crc32(name.encode()) if name else row for row, name in enumerate(placed.ids)]
        velocity_mps = np.nan_to_num(placed.velocity_mps[:, :2], nan=0.0)
        identity = np.array(numbers, dtype=np.int64)
        return time_ns, People(placed.position_m[:, :2], velocity_mps, identity)


def _in_map(seen: SeenPeople, frames: Frames) -> SeenPeople:
    if plain_name(seen.header.frame) == topics.MAP_FRAME:
        return seen
    # A camera's frame is not level; its people are placed in space.
    matrix = frames.place(
        seen.header.frame, topics.MAP_FRAME, at_ns=seen.header.stamp_ns, level=False
    ).matrix
    turn = matrix[:3, :3].T
    position_m, velocity_mps = seen.position_m @ turn + matrix[:3, 3], seen.velocity_mps @ turn
    return replace(seen, position_m=position_m, velocity_mps=velocity_mps)


class PeopleTopic:
    """Calls back with (stamp_ns, people in the map) of each message.

    name: of the topic; fault: why messages cannot be read although it has publishers, else empty.
    """

    def __init__(
        self, endpoints: Endpoints, name: str, take: Callable[[int, People], None]
    ) -> None:
        self.fault = ""
        self._node, self._endpoints = endpoints.node, endpoints
        self.name, self._take_people = name, take
        #: Of the present type.
        self._subscribed: Endpoints | None = None
        self._followed: FollowedTopic | None = None
        self._topic, self._people = Topic(name, MessageType(CLOUD, "", "")), PeopleInMap()
        self._take_cloud = when_placed(endpoints, self._on_cloud, name)
        self._take_message = when_placed(endpoints, self._on_message, name)
        self._subscribe()
        endpoints.every(_LOOK_PERIOD_S, self._look)

    def _on_cloud(self, message: PointCloud2) -> None:
        self._take_people(*from_people_message(message, self._node.frames))

    def _on_message(self, message: Received) -> None:
        try:
            seen = people_in(message.data, self._topic)
        except BagError as error:
            raise MessageError("message must hold people", error, "correct it") from None
        self._take_people(*self._people.convert(seen, self._node.frames))

    def _look(self) -> None:
        """Follow the type of the publishers; while they have several, the present one stays.

        It subscribes at the look after the one that finds another type: the executor keeps the
        subscription of the type before until then.
        """
        if self._subscribed is None:
            self._subscribe()
        found = self._node.get_publishers_info_by_topic(self.name)
        hashes = {each.topic_type: str(each.topic_type_hash) for each in found}
        self.fault = ""
        if hashes and self._topic.type_name not in hashes:
            self._change_type(hashes)
        if self._followed is not None:
            self._followed.look()

    def _change_type(self, hashes: Mapping[str, str]) -> None:
        """Take the first type that can be read; `fault` names why there is none."""
        found = [self._readable(*each) for each in sorted(hashes.items())]
        topic = next((each for each in found if isinstance(each, Topic)), None)
        if topic is None:
            self.fault = "; ".join(map(str, found))
            self._node.get_logger().warning(self.fault, throttle_duration_sec=_LOG_PERIOD_S)
            return
        self._topic, self._people = topic, PeopleInMap()
        if self._subscribed is not None:
            self._endpoints.destroy(self._subscribed)
        self._subscribed = self._followed = None

    def _readable(self, type_name: str, type_hash: str) -> Topic | BagError:
        """The topic of the type, or why it cannot be read: its publishers may have another one."""
        try:
            topic = Topic(self.name, message_type(type_name))
            require_people(topic, self._node.get_name())
            known = topic.message_type.type_hash
            if type_hash.startswith(HASH_START) and known and type_hash != known:
                package = type_name.partition("/")[0]
                raise BagError(
                    f"{topic.name}: {type_name} must be as installed here, {known}, its publishers"
                    f" have {type_hash}; install their version of {package} here"
                )
        except BagError as error:
            return error
        return topic

    def _subscribe(self) -> None:
        name, kind = self._node.resolve_topic_name(self.name), self._topic.type_name
        self._subscribed = scope = self._endpoints.scope()
        if kind == CLOUD:
            scope.subscribe(PointCloud2, self.name, self._take_cloud, qos.STATE)
        else:
            take = self._take_message
            self._followed = FollowedTopic(scope, name, TopicType(kind), take, self.name)
            self._node.get_logger().info(f"{name}: people are received as {kind}")
