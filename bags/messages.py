"""Decoded messages of a bag, by the short names of their topics, whatever their namespace."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from rosbags.highlevel import AnyReader, AnyReaderError

from bags.errors import BagError


def messages_of(directory: Path, names: Sequence[str]) -> Iterator[tuple[str, Any]]:
    """(short topic name, message) of these topics in the order they were logged.

    Raises BagError where the bag cannot be read or has no message of one of them.
    """
    reader = AnyReader([directory])
    try:
        reader.open()
    except (AnyReaderError, OSError, ValueError) as error:
        raise BagError(f"bag {directory} cannot be read ({error}); is its recorder done?") from None
    try:
        chosen = {_short(each.topic): each for each in reader.connections if each.msgcount}
        for name in names:
            if name not in chosen:
                known = ", ".join(sorted(chosen)) or "nothing"
                raise BagError(f"bag {directory} must hold {name}, it holds {known}; record it too")
        for connection, _, data in reader.messages(connections=[chosen[name] for name in names]):
            yield _short(connection.topic), reader.deserialize(data, connection.msgtype)
    finally:
        reader.close()


def _short(topic: str) -> str:
    return topic.rsplit("/", 1)[-1]
