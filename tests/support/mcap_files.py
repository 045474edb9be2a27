"""MCAP files in all forms of the format's specification, written record by record.

Named as in the conformance tests of the format: what a file holds, and which optional parts it has.
"""

import struct
import zlib
from collections.abc import Iterator, Sequence
from enum import Flag, auto
from itertools import chain
from pathlib import Path
from typing import Any

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Message,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.stream_reader import MAGIC_SIZE
from mcap.writer import MCAP0_MAGIC, Writer

_EXTRA = b"\x01\xff\xff"
_SCHEMA = Schema(1, b"int32 a", "ros2msg", "Example")


class Feature(Flag):
    """Optional parts of a file."""

    NONE = 0
    CHUNKS = auto()
    MESSAGE_INDEX = auto()
    CHUNK_INDEX = auto()
    STATISTICS = auto()
    REPEATED_SCHEMAS = auto()
    REPEATED_CHANNELS = auto()
    ATTACHMENT_INDEX = auto()
    METADATA_INDEX = auto()
    SUMMARY_OFFSET = auto()
    EXTRA_DATA = auto()


#: What the files hold, one list of records for each.
CONTENTS: dict[str, list[McapRecord]] = {
    "NoData": [],
    "OneMessage": [_SCHEMA, Channel(1, "example", "a", {"foo": "bar"}, 1),
                   Message(1, 2, b"\1\2\3", 1, 10)],
    "OneSchemalessMessage": [Channel(1, "example", "a", {"foo": "bar"}, 0),
                             Message(1, 2, b"\1\2\3", 1, 10)],
    "OneAttachment": [Attachment(1, 2, "myFile", "application/octet-stream", b"\1\2\3")],
    "OneMetadata": [Metadata("myMetadata", {"foo": "bar"})],
    "TenMessages": [_SCHEMA, Channel(1, "example", "a", {"foo": "bar"}, 1),
                    *(Message(1, 2 + n, bytes([n]), 1 + n, n) for n in range(10))],
}  # fmt: skip


def variants() -> Iterator[tuple[str, Feature]]:
    """Each content with all of the features that it can have."""
    of_messages = (
        Feature.NONE,
        *(Feature.CHUNKS | index for index in (
            Feature.NONE, Feature.MESSAGE_INDEX, Feature.CHUNK_INDEX,
            Feature.MESSAGE_INDEX | Feature.CHUNK_INDEX)),
    )  # fmt: skip
    for name, records in CONTENTS.items():
        kinds = {type(record) for record in records}
        optional = [Feature.STATISTICS, Feature.SUMMARY_OFFSET, Feature.EXTRA_DATA]
        for kind, feature in (
            (Schema, Feature.REPEATED_SCHEMAS),
            (Channel, Feature.REPEATED_CHANNELS),
            (Attachment, Feature.ATTACHMENT_INDEX),
            (Metadata, Feature.METADATA_INDEX),
        ):
            optional += [feature] * (kind in kinds)
        for first in of_messages if Message in kinds else (Feature.NONE,):
            for number in range(2 ** len(optional)):
                chosen = (each for bit, each in enumerate(optional) if number >> bit & 1)
                yield name, sum_of(chain([first], chosen))


def sum_of(features: Iterator[Feature]) -> Feature:
    """All of them."""
    found = Feature.NONE
    for each in features:
        found |= each
    return found


def mcap_file(records: list[McapRecord], features: Feature, *, checksums: bool = True) -> bytes:
    """A file with these records and features."""
    return _File(features, checksums).content(records)


class _File:
    def __init__(self, features: Feature, checksums: bool) -> None:
        self._features, self._checksums = features, checksums
        self._summary: dict[int, list[McapRecord]] = {}
        self._statistics = Statistics(0, 0, {}, 0, 0, 0, 0, 0, 0)

    def content(self, records: list[McapRecord]) -> bytes:
        data = MCAP0_MAGIC + self._encoded(Header("", ""))
        in_chunk = (Schema, Channel, Message) if Feature.CHUNKS in self._features else ()
        chunked = [record for record in records if isinstance(record, in_chunk)]
        if chunked:
            data += self._chunk(chunked, len(data))
        for record in records:
            self._count(record)
            if record not in chunked:
                encoded = self._encoded(record)
                self._index(record, len(data), len(encoded))
                data += encoded
        return data + self._end(data)

    def _chunk(self, records: list[McapRecord], offset: int) -> bytes:
        content, index = b"", MessageIndex(1, [])
        for record in records:
            if isinstance(record, Message):
                index.records.append((record.log_time, len(content)))
            content += self._encoded(record)
        times = [time for time, _ in index.records]
        checksum = zlib.crc32(content) if self._checksums else 0
        chunk = self._encoded(Chunk("", content, max(times), min(times), checksum, len(content)))
        indexes = self._encoded(index) if Feature.MESSAGE_INDEX in self._features else b""
        places = {1: offset + len(chunk)} if indexes else {}
        self._add(Feature.CHUNK_INDEX, ChunkIndex(
            len(chunk), offset, "", len(content), max(times), len(indexes), places, min(times),
            len(content)))  # fmt: skip
        self._statistics.chunk_count += 1
        return chunk + indexes

    def _count(self, record: McapRecord) -> None:
        found = self._statistics
        if isinstance(record, Message):
            first = found.message_start_time if found.message_count else record.log_time
            found.message_start_time = first
            found.message_end_time = record.log_time
            found.message_count += 1
            found.channel_message_counts[1] = found.message_count
        found.schema_count += isinstance(record, Schema)
        found.channel_count += isinstance(record, Channel)
        found.attachment_count += isinstance(record, Attachment)
        found.metadata_count += isinstance(record, Metadata)

    def _index(self, record: McapRecord, offset: int, length: int) -> None:
        if isinstance(record, Attachment):
            self._add(Feature.ATTACHMENT_INDEX, AttachmentIndex(
                offset, length, record.log_time, record.create_time, len(record.data),
                record.name, record.media_type))  # fmt: skip
        elif isinstance(record, Metadata):
            self._add(Feature.METADATA_INDEX, MetadataIndex(offset, length, record.name))

    def _add(self, feature: Feature, record: McapRecord) -> None:
        """Put a record into the summary, where it has such records."""
        if feature in self._features:
            self._summary.setdefault(self._encoded(record)[0], []).append(record)

    def _end(self, data: bytes) -> bytes:
        data_end = self._encoded(DataEnd(zlib.crc32(data) if self._checksums else 0))
        start = len(data) + len(data_end)
        for record in CONTENTS["TenMessages"][:2] if self._statistics.schema_count else ():
            kind = isinstance(record, Schema)
            self._add(Feature.REPEATED_SCHEMAS if kind else Feature.REPEATED_CHANNELS, record)
        if self._statistics.channel_count and not self._statistics.schema_count:
            self._add(Feature.REPEATED_CHANNELS, CONTENTS["OneSchemalessMessage"][0])
        self._add(Feature.STATISTICS, self._statistics)
        summary, offsets = b"", []
        for opcode, records in self._summary.items():
            group = b"".join(map(self._encoded, records))
            offsets.append(SummaryOffset(opcode, start + len(summary), len(group)))
            summary += group
        offset_start = 0
        if Feature.SUMMARY_OFFSET in self._features and offsets:
            offset_start = start + len(summary)
            summary += b"".join(map(self._encoded, offsets))
        footer = encoded(Footer(start if summary else 0, offset_start, 0))
        checksum = zlib.crc32(summary + footer[:-4]) if self._checksums else 0
        return data_end + summary + footer[:-4] + checksum.to_bytes(4, "little") + MCAP0_MAGIC

    def _encoded(self, record: McapRecord) -> bytes:
        """With extra data at the end, which a reader must ignore; data of messages has no end."""
        content = encoded(record)
        if Feature.EXTRA_DATA not in self._features or content[0] == Opcode.MESSAGE:
            return content
        length = len(content) - 9 + len(_EXTRA)
        return content[:1] + length.to_bytes(8, "little") + content[9:] + _EXTRA


def encoded(record: McapRecord) -> bytes:
    """The bytes of a record."""
    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())


def records(content: bytes) -> Iterator[tuple[int, int]]:
    """(opcode, where its content begins) of each record of a file."""
    offset = MAGIC_SIZE
    while offset < len(content) - MAGIC_SIZE:
        opcode, length = struct.unpack_from("<BQ", content, offset)
        yield opcode, offset + 9
        offset += 9 + length


def write_official(path: Path, channels: Sequence[str], n_messages: int, **options: Any) -> list:
    """Write a file with the official writer; returns log time, publish time, data of its messages.

    Messages come on the channels by turns, with an attachment and metadata behind the first five.
    """
    with path.open("wb") as stream:
        writer = Writer(stream, **options)
        writer.start("ros2", "test")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        numbers = {
            name: writer.register_channel(name, "cdr", schema) for name in sorted({*channels})
        }
        messages = [(n + 1, n, b"\0\1\0\0" + bytes([n]) * 20) for n in range(n_messages)]
        for number, (log_time, publish_time, data) in enumerate(messages):
            if number == 5:
                _add_others(writer)
            writer.add_message(
                numbers[channels[number % len(channels)]], log_time, data, publish_time
            )
        if n_messages <= 5:
            _add_others(writer)
        writer.finish()
    return messages


def _add_others(writer: Writer) -> None:
    writer.add_attachment(1, 2, "map.yaml", "text/yaml", b"resolution: 0.05")
    writer.add_metadata("robot", {"name": "one"})
