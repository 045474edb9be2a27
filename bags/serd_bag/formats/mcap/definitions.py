"""Schemas and channels of one MCAP file, wherever they stand: data section, chunks or summary."""

from collections.abc import Iterable, Iterator
from typing import Any

from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from serd_bag.errors import BagError
from serd_bag.formats.limits import MOST_DEFINITIONS
from serd_bag.formats.mcap.records import read_record
from serd_bag.topic import Channel as BagChannel

DEFINITIONS = (int(Opcode.SCHEMA), int(Opcode.CHANNEL))
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
        self._made: dict[int, BagChannel] = {}
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
        self._made = {}
        if records.setdefault(record.id, record) == record:
            self._seen[key] = digest
            return ""
        if self._other is not None and self._other._of[kind].get(record.id) == record:
            records[record.id] = record
        self._n_conflicts += 1
        return _defined_twice(kind, record.id)

    def complete(self, other: "Definitions") -> None:
        """Add what only `other` has."""
        for kind, records in self._of.items():
            records.update({**other._of[kind], **records})
        self._made = {}

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

    def all(self) -> list[BagChannel]:
        """All channels, in the order in which they were defined."""
        return list(map(self.channel, self.channels))

    def channel(self, number: int) -> BagChannel:
        """The channel of that number, with its schema."""
        made = self._made.get(number)
        if made is None:
            found = self.channels[number]
            schema = self.schemas.get(found.schema_id, _UNKNOWN)
            made = self._made[number] = BagChannel(
                topic=found.topic,
                type_name=schema.name,
                encoding=found.message_encoding,
                schema_encoding=schema.encoding,
                schema=schema.data,
                metadata=tuple(found.metadata.items()),
            )
        return made


def _defined_twice(kind: type, number: int) -> str:
    return f"{kind.__name__.lower()} {number} is defined twice, in different ways"
