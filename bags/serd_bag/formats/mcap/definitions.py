"""Schemas and channels of one MCAP file, wherever they stand: data section, chunks or summary."""

from collections.abc import Iterable, Iterator
from functools import lru_cache
from typing import Any

from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from serd_bag.errors import BagError
from serd_bag.formats.limits import MOST_DEFINITIONS
from serd_bag.formats.mcap.records import read_record
from serd_bag.formats.rosbag2.message_types import MessageType
from serd_bag.formats.rosbag2.qos import qos_of_text
from serd_bag.topic import Topic

DEFINITIONS = (int(Opcode.SCHEMA), int(Opcode.CHANNEL))
QOS, TYPE_HASH = "offered_qos_profiles", "topic_type_hash"
_MOST_CONFLICTS = 1000
_UNKNOWN = Schema(0, b"", "", "")


class Definitions:
    """Numbers of channels and what they mean; one number never has two meanings.

    other: definitions from another part of the file. Of two records with one number the one that
    is also there is kept, otherwise the first one.
    """

    def __init__(self, other: "Definitions | None" = None) -> None:
        self._other = other
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self._of: dict[type, dict[int, Any]] = {Schema: self.schemas, Channel: self.channels}
        self._first: dict[str, Channel] = {}
        self._seen: dict[tuple[int, bytes], int] = {}
        self._size = self._n_conflicts = 0

    def add(self, opcode: int, content: bytes) -> str:
        """Keep a schema or channel record; returns its fault, empty where it is sound.

        Writers repeat definitions; one that was read before is not parsed again.
        """
        key, digest = (opcode, content[:2]), hash(content)
        if self._seen.get(key) == digest or self._n_conflicts > _MOST_CONFLICTS:
            return ""
        self._size += len(content)
        if self._size > MOST_DEFINITIONS:
            return f"schemas and channels have more than {MOST_DEFINITIONS} bytes"
        kind = Schema if opcode == Opcode.SCHEMA else Channel
        try:
            record: Any = read_record(kind, content)
        except BagError as error:
            return str(error)
        records = self._of[kind]
        if records.setdefault(record.id, record) == record:
            if kind is Channel:
                self._first.setdefault(record.topic, record)
            self._seen[key] = digest
            return ""
        if self._other is not None and self._other._of[kind].get(record.id) == record:
            records[record.id] = record
            self._find_first()
        self._n_conflicts += 1
        return _defined_twice(kind, record.id)

    def complete(self, other: "Definitions") -> None:
        """Add what only `other` has."""
        for kind, records in self._of.items():
            records.update({**other._of[kind], **records})
        self._find_first()

    def faults_of(self, other: "Definitions") -> Iterator[str]:
        """Describe each number that `other` defines in another way."""
        for kind, own in self._of.items():
            others = other._of[kind]
            for number in own.keys() & others.keys():
                if own[number] != others[number]:
                    yield _defined_twice(kind, number)

    def missing(self, other: "Definitions") -> Iterator[str]:
        """Describe each kind of definitions of which these have some, but not all of `other`."""
        for kind, own in self._of.items():
            if own and other._of[kind].keys() - own.keys():
                yield f"the summary does not have all {kind.__name__.lower()}s"

    def have(self, channels: Iterable[int]) -> bool:
        """Whether these channels and their schemas are known."""
        schemas = {0, *self.schemas}
        found = [self.channels.get(number) for number in channels]
        return all(each is not None and each.schema_id in schemas for each in found)

    def topics(self) -> list[Topic]:
        """Topics of all channels, each once."""
        return list(map(self._topic, self._first.values()))

    def is_of_its_topic(self, number: int) -> bool:
        """Whether a channel has the type of the first one of its topic, if both are known."""
        channel = self.channels[number]
        own, first = self._schema(channel), self._schema(self._first[channel.topic])
        if not (own.data and first.data):
            return True
        return own.name == first.name and _fields(own.data) == _fields(first.data)

    def names(self, number: int) -> tuple[str, str]:
        """(topic, type name) of a channel."""
        channel = self.channels[number]
        return channel.topic, self._schema(channel).name

    def _find_first(self) -> None:
        """Find the first channel of each topic anew."""
        self._first = {}
        for channel in self.channels.values():
            self._first.setdefault(channel.topic, channel)

    def _schema(self, channel: Channel) -> Schema:
        return self.schemas.get(channel.schema_id, _UNKNOWN)

    def _topic(self, channel: Channel) -> Topic:
        schema = self._schema(channel)
        text = schema.data.decode("utf-8", errors="replace")
        type_hash = channel.metadata.get(TYPE_HASH, "")
        recorded = MessageType(schema.name, text, type_hash, schema.encoding)
        qos = qos_of_text(channel.metadata.get(QOS, ""))
        return Topic(channel.topic, recorded, qos, channel.message_encoding)


def _defined_twice(kind: type, number: int) -> str:
    return f"{kind.__name__.lower()} {number} is defined twice, in different ways"


@lru_cache(maxsize=256)
def _fields(definition: bytes) -> list[list[bytes]]:
    """The words of each line of a definition that has any but a comment."""
    lines = (line.split(b"#")[0].split() for line in definition.splitlines())
    return [words for words in lines if words]
