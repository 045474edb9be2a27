"""Decoded messages of a bag, by the short names of their topics, whatever their namespace."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from bags.errors import BagError
from bags.reader import BagReader, RawMessage
from bags.rosbag2.topic_definition import definition_of
from bags.rosbag2.topic_info import TopicInfo


def messages_of(directory: Path, names: Sequence[str]) -> Iterator[tuple[str, Any]]:
    """(short topic name, message) of these topics in the order they were recorded.

    Raises BagError where the bag is damaged or has no message of one of them.
    """
    reader = BagReader(directory)
    chosen = {_short(name): topic for name, topic in reader.topics.items()}
    store = _store([chosen[name] for name in names if name in chosen])
    found: set[str] = set()
    for message in reader.messages([chosen[name].name for name in names if name in chosen]):
        found.add(_short(message.topic))
        yield _short(message.topic), _decoded(store, message)
    for name in names:
        if name not in found:
            filled = {_short(message.topic) for message in reader.messages()}
            known = ", ".join(sorted(filled)) or "nothing"
            raise BagError(f"bag {directory} must hold {name}, it holds {known}; record it too")


def _store(topics: Sequence[TopicInfo]) -> Typestore:
    store = get_typestore(Stores.EMPTY)
    for topic in topics:
        store.register(get_types_from_msg(definition_of(topic).text, topic.type_name))
    return store


def _decoded(store: Typestore, message: RawMessage) -> Any:
    try:
        return store.deserialize_cdr(message.data, message.type_name)
    except Exception as error:  # generated code meeting foreign bytes raises of any kind
        raise BagError(
            f"a message on {message.topic} is no {message.type_name}"
            f" ({type(error).__name__}: {error}); look at what published it"
        ) from None


def _short(topic: str) -> str:
    return topic.rsplit("/", 1)[-1]
