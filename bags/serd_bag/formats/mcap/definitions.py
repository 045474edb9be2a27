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
_DEFINED_TWICE = "{what} is defined twice, in different ways"
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
        try:
            self._size += len(content)
            if self._size > MOST_DEFINITIONS:
                raise BagError(f"schemas and channels have more than {MOST_DEFINITIONS} bytes")
            same, what = self._add(opcode, content)
        except BagError as error:
            return str(error)
        if same:
            self._seen[key] = digest
            return ""
        self._n_conflicts += 1
        return _DEFINED_TWICE.format(what=what)

    def complete(self, other: "Definitions") -> None:
        """Add what only `other` has."""
        self.schemas = other.schemas | self.schemas
        self.channels.update({**other.channels, **self.channels})
        for channel in self.channels.values():
            self._first.setdefault(channel.topic, channel)

    def faults_of(self, other: "Definitions") -> Iterator[str]:
        """Describe each number that `other` defines in another way."""
        for kind, own, others in self._beside(other):
            for number in own.keys() & others.keys():
                if own[number] != others[number]:
                    yield _DEFINED_TWICE.format(what=f"{kind} {number}")

    def missing(self, other: "Definitions") -> Iterator[str]:
        """Describe each kind of definitions of which these have some, but not all of `other`."""
        for kind, own, others in self._beside(other):
            if own and others.keys() - own.keys():
                yield f"the summary does not have all {kind}s"

    def _beside(self, other: "Definitions") -> Iterator[tuple[str, dict[int, Any], dict[int, Any]]]:
        yield "schema", self.schemas, other.schemas
        yield "channel", self.channels, other.channels

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

    def _add(self, opcode: int, content: bytes) -> tuple[bool, str]:
        """(whether it is new or the same as before, kind and number)."""
        if opcode == Opcode.SCHEMA:
            schema = read_record(Schema, content)
            same = self.schemas.setdefault(schema.id, schema) == schema
            if not same and self._other and self._other.schemas.get(schema.id) == schema:
                self.schemas[schema.id] = schema
            return same, f"schema {schema.id}"
        channel = read_record(Channel, content)
        kept = self.channels.setdefault(channel.id, channel)
        same = kept == channel
        if not same and self._other and self._other.channels.get(channel.id) == channel:
            self.channels[channel.id] = channel
            if self._first[kept.topic] is kept:
                del self._first[kept.topic]
        kept = self.channels[channel.id]
        self._first.setdefault(kept.topic, kept)
        return same, f"channel {channel.id}"

    def _schema(self, channel: Channel) -> Schema:
        return self.schemas.get(channel.schema_id, _UNKNOWN)

    def _topic(self, channel: Channel) -> Topic:
        schema = self._schema(channel)
        text = schema.data.decode("utf-8", errors="replace")
        type_hash = channel.metadata.get(TYPE_HASH, "")
        recorded = MessageType(schema.name, text, type_hash, schema.encoding)
        qos = qos_of_text(channel.metadata.get(QOS, ""))
        return Topic(channel.topic, recorded, qos, channel.message_encoding)


@lru_cache(maxsize=256)
def _fields(definition: bytes) -> list[list[bytes]]:
    """The words of each line of a definition that has any but a comment."""
    lines = (line.split(b"#")[0].split() for line in definition.splitlines())
    return [words for words in lines if words]
