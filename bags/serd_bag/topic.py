"""Topics of a bag and their messages, and how a topic is found by its name."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import NamedTuple

from serd_bag.errors import BagError
from serd_bag.formats.rosbag2.qos import QosProfile, qos_of_text, qos_text
from serd_bag.nearest import nearest_name

CDR, ROS1 = "cdr", "ros1"
#: Of definitions.
ROS2MSG, ROS2IDL, ROS1MSG = "ros2msg", "ros2idl", "ros1msg"
#: Names of values that rosbag2 keeps with an MCAP channel.
QOS, TYPE_HASH = "offered_qos_profiles", "topic_type_hash"


@dataclass(frozen=True)
class MessageType:
    """The definition of a message type.

    name: as `geometry_msgs/msg/Twist`; text: definition with dependencies; type_hash: RIHS01.

    encoding: how the text is written, `ros2msg` or `ros2idl`, empty where there is no text.
    """

    name: str
    text: str
    type_hash: str
    encoding: str = ROS2MSG


@dataclass(frozen=True)
class Channel:
    """A stream of messages as a file holds it; nothing of it is interpreted.

    encoding, schema_encoding: of the messages and of the schema, their definition; metadata: pairs
    of texts, rosbag2 has quality of service and type hash there. One topic may have several.
    """

    topic: str
    type_name: str = ""
    encoding: str = CDR
    schema_encoding: str = ""
    schema: bytes = b""
    metadata: tuple[tuple[str, str], ...] = ()

    def value(self, name: str) -> str:
        """The metadata of that name, empty where there is none."""
        return dict(self.metadata).get(name, "")


class Record(NamedTuple):
    """One message as a file holds it; times in ns; sequence: number that its sender gave it."""

    channel: Channel
    sequence: int
    data: bytes
    log_time_ns: int
    publish_time_ns: int


@dataclass(frozen=True)
class Topic:
    """A topic of a bag and the type of its messages.

    name: with leading slash; qos: offered by its publishers; encoding: of the messages.

    In a bag that was read, message_type holds what the bag holds: text and hash may be empty.
    """

    name: str
    message_type: MessageType
    qos: tuple[QosProfile, ...] = ()
    encoding: str = CDR

    @property
    def type_name(self) -> str:
        """Name of the message type."""
        return self.message_type.name

    @property
    def channel(self) -> Channel:
        """How a file of rosbag2 holds it."""
        kind = self.message_type
        metadata = ((QOS, qos_text(self.qos)), (TYPE_HASH, kind.type_hash))
        schema = kind.text.encode()
        return Channel(self.name, kind.name, self.encoding, kind.encoding, schema, metadata)


def topic_of(channel: Channel) -> Topic:
    """The topic of a channel, as far as its metadata can be read."""
    text = channel.schema.decode("utf-8", errors="replace")
    type_hash = channel.value(TYPE_HASH)
    recorded = MessageType(channel.type_name, text, type_hash, channel.schema_encoding)
    return Topic(channel.topic, recorded, qos_of_text(channel.value(QOS)), channel.encoding)


class RawMessage(NamedTuple):
    """One message of a bag; data: the serialized message as recorded, in CDR unless its topic
    has another encoding; log time: when it was received, publish time: when it was sent."""

    topic: str
    type_name: str
    data: bytes
    log_time_ns: int
    publish_time_ns: int


def topic_named(topics: Collection[str], name: str) -> str:
    """The one topic of that name; BagError where there is none or more than one."""
    found = topics_named(topics, name)
    if len(found) == 1:
        return found[0]
    known = ", ".join(sorted(found or topics)) or "nothing"
    if found:
        raise BagError(f"topic {name!r} must be one topic, the bag holds {known}; name it in full")
    fix = nearest_topic(topics, name)
    fix = f"did you mean {fix!r}?" if fix else "name one of them"
    raise BagError(f"bag must hold the topic {name!r}, it holds {known}; {fix}")


def topics_named(topics: Collection[str], name: str) -> list[str]:
    """The topic itself where the bag has it, else the topics of that name in any namespace.

    A name that begins with "/" is complete, as everywhere in ROS.
    """
    if name in topics:
        return [name]
    return [] if name.startswith("/") else [each for each in topics if each.endswith(f"/{name}")]


def nearest_topic(topics: Collection[str], name: str) -> str | None:
    """The topic whose name, with or without its namespace, is most like `name`."""
    full = {topic: topic for topic in sorted(topics)}
    short = {topic.rsplit("/", 1)[-1]: topic for topic in sorted(topics)}
    near = nearest_name(name, {**short, **full})
    return None if near is None else {**short, **full}[near]


def selected_topics(available: Collection[str], wanted: Collection[str]) -> frozenset[str]:
    """Full names of the wanted topics; all topics where none is wanted."""
    return frozenset(topic_named(available, name) for name in wanted) or frozenset(available)
