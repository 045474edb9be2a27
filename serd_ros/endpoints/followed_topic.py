"""Raw subscriptions with the times of each message, and with the quality of service of publishers.

A subscription matches a publisher when it requests no more than is offered: reliability, and
messages from before it was made (transient local). So it requests what all publishers offer; where
only some are latched, it first receives what these have kept.
"""

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from serd_bag.errors import BagError
from serd_bag.formats.rosbag2.message_types import rosbags_types
from serd_bag.messages.plain import Transform, transforms
from serd_ros.convert.frames import Frames
from serd_ros.convert.motion import PlanarPose, odom_in_map, to_quaternion
from serd_ros.convert.stamp import to_stamp
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.endpoints import Endpoints, waiting_messages
from serd_ros.endpoints.qos import common_qos, is_latched, recording_qos
from serd_ros.endpoints.topic_types import TopicType
from serd_ros.errors import MessageError
from serd_sim.robot.urdf import LinkTransform, Placed


@dataclass(frozen=True)
class Received:
    """A raw message; received_ns, sent_ns: by the clocks of this machine and the publisher's.

    sent_ns is 0 where not stated.
    """

    topic: str
    data: bytes
    received_ns: int
    sent_ns: int


class FollowedTopic:
    """Subscribes at once where the type has a profile, else as soon as there is a publisher.

    name: in full; take: called with each message; topic: by which bad ones are counted, the name
    when empty; offered: by the publishers there were when it subscribed.
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
        self._others: list[str] = []
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
        offered = [each.qos_profile for each in found if each.topic_type == self.kind.name]
        self._others = [] if offered else sorted({each.topic_type for each in found})
        if not offered:
            return False
        if self._subscription is None:
            self.offered = tuple(offered)
            latched = [each for each in offered if is_latched(each)]
            self._subscription = self._subscribe(common_qos(latched or offered))
            return True
        self._subscription = self._endpoints.matching(
            self._subscription, offered, self._subscribe, self._take_received
        )
        return False

    @property
    def silence(self) -> str:
        """Why no message can arrive, as far as is known, else empty."""
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
        received_ns = max(info["received_timestamp"], 0) or time.time_ns()
        return Received(self.name, data, received_ns, info["source_timestamp"])

    def _subscribe(self, profile: QoSProfile) -> Subscription:
        return self._endpoints.subscribe_raw(
            self.kind.message, self.name, self._take_received, profile
        )


TF_TYPE = "tf2_msgs/msg/TFMessage"
_LOOK_PERIOD_S = 0.5


def follow_transforms(endpoints: Endpoints, on_change: Callable[[], None] = lambda: None) -> None:
    """Keep the frames of the node as /tf is; on_change: called after each message of /tf.

    Of a message with a bad transform the others are taken.
    """
    node = endpoints.node

    def take(message: Received, *, static: bool) -> None:
        try:
            found = transforms(message.data, TF_TYPE, rosbags_types())
        except BagError as error:
            raise MessageError(f"message must be a {TF_TYPE}", error, "correct it") from None
        faults = [_fault_of(node.frames, each, static=static) for each in found]
        if not static:
            on_change()
        for error in filter(None, faults):
            raise error

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
