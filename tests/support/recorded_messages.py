"""Messages of a bag, as objects."""

from pathlib import Path
from typing import Any

from rosbags.highlevel import AnyReader


def recorded(bag: Path, topic: str) -> list[Any]:
    """The first message of each stamp, in their order."""
    found: dict[tuple[int, int], Any] = {}
    with AnyReader([bag]) as reader:
        wanted = [each for each in reader.connections if each.topic == topic]
        for connection, _, raw in reader.messages(wanted):
            message: Any = reader.deserialize(raw, connection.msgtype)
            found.setdefault((message.header.stamp.sec, message.header.stamp.nanosec), message)
    return [found[stamp] for stamp in sorted(found)]
