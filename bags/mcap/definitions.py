"""Schemas and channels of an MCAP file, as its readers collect them."""

import struct
from dataclasses import dataclass, field

from bags.errors import BagError
from bags.mcap.format import Cursor


@dataclass(frozen=True)
class Schema:
    """A message definition."""

    name: str
    encoding: str
    text: str


@dataclass(frozen=True)
class Channel:
    """A topic with its metadata (QoS profiles, type hash)."""

    topic: str
    schema_id: int
    encoding: str
    metadata: tuple[tuple[str, str], ...]


@dataclass
class Definitions:
    """Schemas and channels by their numbers; the same number never means two things."""

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)

    def add_schema(self, content: bytes) -> None:
        """Take note of a schema record; BagError where it is damaged or contradicts another."""
        try:
            cursor = Cursor(content)
            (number,) = cursor.numbers("H")
            schema = Schema(cursor.text(), cursor.text(), cursor.text())
        except (struct.error, UnicodeError) as error:
            raise BagError(f"a schema record is damaged ({error})") from None
        _require_whole("schema", cursor)
        if self.schemas.setdefault(number, schema) != schema:
            raise BagError(f"schema {number} is given twice and differs")

    def add_channel(self, content: bytes) -> None:
        """Take note of a channel record; BagError where it is damaged or contradicts another."""
        try:
            cursor = Cursor(content)
            number, schema_id = cursor.numbers("HH")
            topic, encoding = cursor.text(), cursor.text()
            channel = Channel(topic, schema_id, encoding, tuple(cursor.text_map().items()))
        except (struct.error, UnicodeError) as error:
            raise BagError(f"a channel record is damaged ({error})") from None
        _require_whole("channel", cursor)
        if self.channels.setdefault(number, channel) != channel:
            raise BagError(f"channel {number} is given twice and differs")


def _require_whole(kind: str, cursor: Cursor) -> None:
    if not cursor.at_end:
        raise BagError(f"a {kind} record is damaged (it is longer than its fields)")
