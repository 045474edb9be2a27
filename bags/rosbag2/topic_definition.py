"""The message definition of a recorded topic: the bag's own, else the installed one."""

from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from bags.errors import BagError
from bags.rosbag2.message_types import ENCODING, MessageType, message_type
from bags.rosbag2.topic_info import TopicInfo


def definition_of(topic: TopicInfo) -> MessageType:
    """The definition as text; BagError where neither the bag nor this computer has it."""
    if topic.text and topic.text_encoding == ENCODING:
        return MessageType(topic.type_name, topic.text, topic.type_hash or _hash_of(topic))
    installed = message_type(topic.type_name)
    if topic.type_hash not in ("", installed.type_hash):
        raise BagError(
            f"message type {topic.type_name!r} is installed in another version than that of"
            f" {topic.name}; install the version that was recorded"
        )
    return installed


def kept_definition(topic: TopicInfo) -> MessageType:
    """What a copy of the bag says of the type: all that is known, as rosbag2 does too."""
    try:
        return definition_of(topic)
    except BagError:
        encoding = topic.text_encoding if topic.text else ""
        return MessageType(topic.type_name, topic.text, topic.type_hash, encoding)


def _hash_of(topic: TopicInfo) -> str:
    """RIHS01 of a definition recorded without (rosbag2 before Jazzy); empty if it lacks a part."""
    store = get_typestore(Stores.EMPTY)
    try:
        store.register(get_types_from_msg(topic.text, topic.type_name))
        return store.hash_rihs01(topic.type_name)
    except Exception:  # a recorded text may be anything
        return ""
