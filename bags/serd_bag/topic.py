"""Topics of a bag and their messages, and how a topic is found by its name."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import NamedTuple

from serd_bag.errors import BagError
from serd_bag.formats.rosbag2.message_types import MessageType
from serd_bag.formats.rosbag2.qos import QosProfile
from serd_bag.nearest import nearest_name

CDR = "cdr"


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
