"""Decoded messages of a bag, by the short names of their topics in any namespace."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from serd_bag.errors import BagError
from serd_bag.formats.rosbag2.message_types import resolve_type, typestore_of
from serd_bag.messages.plain import decode
from serd_bag.reader import BagReader


def messages_of(directory: Path, names: Sequence[str]) -> Iterator[tuple[str, Any]]:
    """(short topic name, message) of these topics in the order they were recorded.

    Raises BagError where the bag is damaged or has no message of one of them.
    """
    reader = BagReader(directory)
    topics = {_short(name): topic for name, topic in reader.topics.items()}
    chosen = {topics[name].name: topics[name] for name in names if name in topics}
    stores = {
        name: typestore_of(resolve_type(topic.message_type)) for name, topic in chosen.items()
    }
    found: set[str] = set()
    for message in reader.messages(chosen):
        found.add(_short(message.topic))
        try:
            yield (
                _short(message.topic),
                decode(message.data, message.type_name, stores[message.topic]),
            )
        except BagError as error:
            raise BagError(f"bag {directory}, {message.topic}: {error}") from None
    for name in names:
        if name not in found:
            filled = {_short(message.topic) for message in reader.messages()}
            known = ", ".join(sorted(filled)) or "nothing"
            raise BagError(f"bag {directory} must hold {name}, it holds {known}; give another bag")


def _short(topic: str) -> str:
    return topic.rsplit("/", 1)[-1]
