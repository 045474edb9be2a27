"""MCAP files in all forms of the format's specification, by the official writer.

Named as in the conformance tests of the format: what a file holds, and which optional parts it has.
"""

import struct
from collections.abc import Iterator, Sequence
from enum import Flag, auto
from functools import reduce
from io import BytesIO
from operator import or_
from pathlib import Path
from typing import Any
from unittest.mock import patch

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import MAGIC_SIZE
from mcap.writer import CompressionType, IndexType, Writer

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
                yield name, reduce(or_, chosen, first)


_INDEXES = {
    Feature.MESSAGE_INDEX: IndexType.MESSAGE,
    Feature.CHUNK_INDEX: IndexType.CHUNK,
    Feature.ATTACHMENT_INDEX: IndexType.ATTACHMENT,
    Feature.METADATA_INDEX: IndexType.METADATA,
}


class _Extended(RecordBuilder):
    """Writes extra data at the end of records, which readers must ignore; messages have no end."""

    def finish_record(self) -> None:
        opcode = self._buffer.getvalue()[self._record_start_offset]
        if opcode not in (Opcode.MESSAGE, Opcode.FOOTER):
            self.write(_EXTRA)
        super().finish_record()


def mcap_file(records: list[McapRecord], features: Feature, *, checksums: bool = True) -> bytes:
    """A file with these records and features."""
    builder = _Extended if Feature.EXTRA_DATA in features else RecordBuilder
    stream, indexes = BytesIO(), (each for has, each in _INDEXES.items() if has in features)
    with (
        patch("mcap.writer.RecordBuilder", builder),
        patch("mcap._chunk_builder.RecordBuilder", builder),
    ):
        writer = Writer(
            stream,
            compression=CompressionType.NONE,
            index_types=reduce(or_, indexes, IndexType.NONE),
            repeat_channels=Feature.REPEATED_CHANNELS in features,
            repeat_schemas=Feature.REPEATED_SCHEMAS in features,
            use_chunking=Feature.CHUNKS in features,
            use_statistics=Feature.STATISTICS in features,
            use_summary_offsets=Feature.SUMMARY_OFFSET in features,
            enable_crcs=checksums,
            enable_data_crcs=checksums,
        )
        writer.start(library="")
        for each in records:
            _add(writer, each)
        writer.finish()
    return stream.getvalue()


def _add(writer: Writer, record: McapRecord) -> None:
    """Add a record; the only channel and the only schema have the number 1."""
    if isinstance(record, Schema):
        writer.register_schema(record.name, record.encoding, record.data)
    elif isinstance(record, Channel):
        writer.register_channel(
            record.topic, record.message_encoding, record.schema_id, record.metadata
        )
    elif isinstance(record, Metadata):
        writer.add_metadata(record.name, record.metadata)
    elif isinstance(record, Message):
        writer.add_message(**vars(record))
    elif isinstance(record, Attachment):
        writer.add_attachment(**vars(record))


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
