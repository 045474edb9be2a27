"""Records of damaged MCAP files: those of the `mcap` package, read with every size checked.

The readers of that package take what a stream gives; here a record that ends early, is longer than
its fields or fails its checksum is a BagError.
"""

import os
import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, TypeVar

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    Footer,
    McapRecord,
    MessageIndex,
    Schema,
    Statistics,
)
from mcap.stream_reader import MAGIC_SIZE, CRCValidationError, get_chunk_data_stream
from mcap.summary import Summary
from mcap.writer import MCAP0_MAGIC

from bags.errors import BagError
from storage.errors import disk_error

#: opcode, length of the content
RECORD_HEAD = struct.Struct("<BQ")
#: opcode, length; channel, sequence, log time, publish time
MESSAGE_HEAD = struct.Struct("<BQHIQQ")
_FOOTER_SIZE = RECORD_HEAD.size + 20
_CHECKSUM_SIZE = 4
_LARGEST_CHUNK = 1 << 30

AnyRecord = TypeVar("AnyRecord", bound=McapRecord)


class _StrictStream(ReadDataStream):
    def read(self, length: int) -> bytes:
        data = super().read(length)
        if len(data) < length:
            raise EndOfFile
        return data


def read_record(kind: type[AnyRecord], content: bytes) -> AnyRecord:
    """The record with this content; BagError where it does not have exactly its fields."""
    stream = _StrictStream(BytesIO(content))
    name = kind.__name__.lower()
    try:
        record: AnyRecord = kind.read(stream)  # type: ignore[attr-defined]
    except (McapError, struct.error, UnicodeError, OverflowError) as error:
        raise BagError(f"a {name} record is damaged ({error or 'it ends early'})") from None
    if stream.count != len(content):
        raise BagError(f"a {name} record is damaged (it is longer than its fields)")
    return record


def chunk_records(content: bytes) -> bytes:
    """The records in a chunk record; BagError where size or checksum are not as written."""
    chunk = read_record(Chunk, content)
    size, compression = chunk.uncompressed_size, chunk.compression
    if size > _LARGEST_CHUNK:
        raise BagError(f"a chunk must have {_LARGEST_CHUNK} bytes at most, got {size}")
    if compression not in ("", "zstd", "lz4"):
        raise BagError(f"compression of a chunk must be zstd, lz4 or none, got {compression!r}")
    try:
        if compression == "zstd" and zstandard.frame_content_size(chunk.data) > size:
            raise BagError(f"a chunk must unpack to {size} bytes, its frame is larger")
        stream, length = get_chunk_data_stream(chunk, validate_crc=True)
    except CRCValidationError:
        raise BagError("the checksum of a chunk does not fit its content") from None
    except (zstandard.ZstdError, RuntimeError, MemoryError) as error:
        raise BagError(f"a chunk cannot be unpacked ({error})") from None
    if length != size:
        raise BagError(f"a chunk must have {size} bytes, got {length}")
    return stream.read(length)


def torn_chunk_records(content: bytes) -> bytes:
    """The records in a chunk record whose end is missing; none where it was compressed."""
    try:
        chunk = Chunk.read(ReadDataStream(BytesIO(content)))
    except (McapError, struct.error, UnicodeError, OverflowError):
        return b""
    records = bytes(chunk.data[: chunk.uncompressed_size])
    complete = len(records) == chunk.uncompressed_size
    checksum = chunk.uncompressed_crc
    if chunk.compression or (complete and checksum and zlib.crc32(records) != checksum):
        return b""
    return records


def read_summary(path: Path) -> Summary | None:
    """The summary at the end of the file, None where there is no complete and sound one."""
    try:
        with path.open("rb") as stream:
            return _summary(stream)
    except OSError as error:
        raise BagError(str(disk_error("read", path, error))) from None
    except BagError:
        return None


def _summary(stream: BinaryIO) -> Summary | None:
    size = os.fstat(stream.fileno()).st_size
    footer_start = size - MAGIC_SIZE - _FOOTER_SIZE
    if footer_start < MAGIC_SIZE:
        return None
    stream.seek(footer_start)
    footer_bytes = stream.read(_FOOTER_SIZE)
    if stream.read() != MCAP0_MAGIC or footer_bytes[0] != Opcode.FOOTER:
        return None
    footer = read_record(Footer, footer_bytes[RECORD_HEAD.size :])
    if not MAGIC_SIZE <= footer.summary_start <= footer_start:
        return None
    stream.seek(footer.summary_start)
    content = stream.read(footer_start - footer.summary_start)
    checksum = zlib.crc32(footer_bytes[:-_CHECKSUM_SIZE], zlib.crc32(content))
    if footer.summary_crc not in (0, checksum):
        return None
    return _parsed(content)


def _parsed(content: bytes) -> Summary:
    summary = Summary()
    offset = 0
    while offset + RECORD_HEAD.size <= len(content):
        opcode, length = RECORD_HEAD.unpack_from(content, offset)
        start = offset + RECORD_HEAD.size
        offset = start + length
        record = content[start:offset]
        if opcode == Opcode.SCHEMA:
            schema = read_record(Schema, record)
            summary.schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = read_record(Channel, record)
            summary.channels[channel.id] = channel
        elif opcode == Opcode.CHUNK_INDEX:
            summary.chunk_indexes.append(read_record(ChunkIndex, record))
        elif opcode == Opcode.STATISTICS:
            summary.statistics = read_record(Statistics, record)
    return summary


def index_matches(records: bytes, indexes: list[bytes]) -> bool:
    """Whether the contents of a chunk's message indexes list each of its messages where it is.

    Players that jump to a time trust the index. A chunk without any is as good: the format leaves
    them to the writer.
    """
    try:
        read = [read_record(MessageIndex, content) for content in indexes]
    except BagError:
        return False
    listed = [(index.channel_id, *entry) for index in read for entry in index.records]
    return not indexes or sorted(listed) == sorted(_positions(records))


def _positions(records: bytes) -> Iterator[tuple[int, int, int]]:
    """(channel, log time, offset) of each message."""
    offset = 0
    while offset + RECORD_HEAD.size <= len(records):
        opcode, length = RECORD_HEAD.unpack_from(records, offset)
        if opcode == Opcode.MESSAGE and length >= MESSAGE_HEAD.size - RECORD_HEAD.size:
            _, _, channel, _, log_time, _ = MESSAGE_HEAD.unpack_from(records, offset)
            yield channel, log_time, offset
        offset += RECORD_HEAD.size + length
