"""/tf and /tf_static into the frames of a node, and the transforms of a simulated robot to /tf.

They travel as bytes, since tf2_msgs has no wheel; the topics are relative, so that a robot in a
namespace has its own.
"""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

from serd_bag.errors import BagError
from serd_bag.formats.rosbag2.message_types import rosbags_types
from serd_bag.messages.plain import transforms
from serd_ros.convert.pose import PlanarPose, odom_in_map, to_quaternion
from serd_ros.convert.stamp import to_stamp
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.endpoints import Endpoints
from serd_ros.endpoints.followed_topic import FollowedTopic, Received
from serd_ros.endpoints.topic_types import TopicType
from serd_ros.errors import MessageError
from serd_sim.robot.urdf import LinkTransform, Placed

TF_TYPE = "tf2_msgs/msg/TFMessage"
_LOOK_PERIOD_S = 0.5


def follow_transforms(endpoints: Endpoints, on_change: Callable[[], None] = lambda: None) -> None:
    """Keep the frames of the node as /tf is; on_change: called after each message of /tf.

    Of a message with a bad transform the others are taken.
    """
    node = endpoints.node

    @contextmanager
    def collected(errors: list[MessageError]) -> Iterator[None]:
        try:
            yield
        except MessageError as error:
            errors.append(error)

    def take(message: Received, *, static: bool) -> None:
        try:
            found = transforms(message.data, TF_TYPE, rosbags_types())
        except BagError as error:
            raise MessageError(f"message must be a {TF_TYPE}", error, "correct it") from None
        errors: list[MessageError] = []
        for each in found:
            with collected(errors):
                node.frames.take(each, static=static)
        if not static:
            on_change()
        if errors:
            raise errors[0]

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
