"""Messages of ROS 1 as the ROS 2 messages of the same fields, by the definition in the bag.

rosbags turns each message into CDR. The Header of ROS 2 has no `seq`.
"""

from functools import lru_cache

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.msg import normalize_msgtype
from rosbags.typesys.store import Typestore

from serd_bag.formats.limits import LARGEST_MESSAGE
from serd_bag.formats.rosbag2.qos import RELIABLE
from serd_bag.topic import CDR, Channel, MessageType, Topic

_HEADER = "std_msgs/msg/Header"


def converted_topic(channel: Channel) -> Topic:
    """The topic of ROS 2; its type has no text where the definition cannot be read."""
    return _converted(channel)[0]


def can_convert(channel: Channel) -> bool:
    """Whether the definition of a channel can be read."""
    return _converted(channel)[1] is not None


def converted(channel: Channel, data: bytes) -> bytes | None:
    """The message in CDR, None where it does not fit its definition."""
    topic, store = _converted(channel)
    if store is None or len(data) > LARGEST_MESSAGE:
        return None
    try:
        return bytes(store.ros1_to_cdr(data, topic.type_name))
    except Exception:  # generated code raises errors of any kind for foreign bytes
        return None


@lru_cache(maxsize=256)
def _converted(channel: Channel) -> tuple[Topic, Typestore | None]:
    name = channel.type_name
    try:
        name, text = normalize_msgtype(name), channel.schema.decode()
        types = get_types_from_msg(text, name)
        if _HEADER in types:
            constants, fields = types[_HEADER]
            types[_HEADER] = constants, [each for each in fields if each[0] != "seq"]
        store = get_typestore(Stores.EMPTY)
        store.register(types)
        definition, _ = store.generate_msgdef(name, ros_version=2)
        recorded = MessageType(name, definition, store.hash_rihs01(name))
    except Exception:  # a recorded text may be anything
        return Topic(channel.topic, MessageType(name, "", "", ""), (RELIABLE,), CDR), None
    return Topic(channel.topic, recorded, (RELIABLE,), CDR), store
