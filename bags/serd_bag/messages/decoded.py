"""Decoded messages of a bag, by the short names of their topics in any namespace."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from serd_bag.errors import BagError
from serd_bag.messages.fields import store_of
from serd_bag.messages.plain import decode
from serd_bag.reader import BagReader
from serd_bag.topic import topic_named


def messages_of(directory: Path, names: Sequence[str]) -> Iterator[tuple[str, Any]]:
    """(short topic name, message) of these topics in the order they were recorded.

    Raises BagError where the bag is damaged or has no message of one of them.
    """
    reader = BagReader(directory)
    short = {topic_named(reader.topics, name): name for name in names}
    stores = {topic: store_of(reader.topics[topic]) for topic in short}
    missing = set(names)
    for topic, type_name, data, *_ in reader.messages(short):
        missing.discard(short[topic])
        try:
            message = decode(data, type_name, stores[topic])
        except BagError as error:
            raise BagError(f"bag {directory}, {topic}: {error}") from None
        yield short[topic], message
    if missing:
        raise BagError(f"bag {directory} must hold {min(missing)}, it has none; give another bag")
