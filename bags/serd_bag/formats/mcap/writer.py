"""One MCAP file, written in small chunks with checksums, each appended whole.

The records are those of the `mcap` package. Its writer is not used: it encodes messages at half
the speed and cannot append a chunk and its index as one block. Schemas and channels are in the
summary and in chunks, under their checksums: in the three chunks from the first one on, so that two
chunks that are lost cost no more than themselves, and then each time their number has doubled.
"""

import contextlib
import os
import struct
import zlib
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    AttachmentIndex,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.records import Channel as McapChannel
from mcap.well_known import Profile
from mcap.writer import MCAP0_MAGIC

from serd_bag.errors import BagError, disk_errors
from serd_bag.formats.mcap.chunks import chunk_head
from serd_bag.formats.mcap.records import MESSAGE_HEAD, RECORD_HEAD, CopiedIndex, copied_index
from serd_bag.formats.mcap.summary_index import entry_of_chunk
from serd_bag.formats.mcap.window import FileWindow
from serd_bag.formats.rosbag2.layout import FileSpan
from serd_bag.topic import Channel

Compression = Literal["none", "zstd"]
LIBRARY = "serd"
_FIELDS_SIZE = MESSAGE_HEAD.size - RECORD_HEAD.size
_MESSAGE = int(Opcode.MESSAGE)
_LARGEST_CHUNK = 256 * 1024
_SIZE = struct.Struct("<Q")
_REPEATED_AT_ONCE = 2
_BLOCK = 1 << 20
_METADATA_NAME = "rosbag2"


class McapWriter:
    """Appends messages to one file; what `flush` has written survives the death of the process.

    The file is unbuffered and only grows, in whole blocks: what was appended before a failure stays
    readable. sync: wait for the disk at each flush.
    """

    def __init__(
        self,
        path: Path,
        *,
        compression: Compression = "none",
        sync: bool = False,
        profile: str = Profile.ROS2,
    ) -> None:
        self._path, self._compression, self._sync = path, compression, sync
        self._size = 0
        with disk_errors("write", path, BagError):
            self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
        #: numbers of schemas by name, encoding and text
        self._schemas: dict[tuple[str, str, bytes], int] = {}
        self._n_schemas = 0
        self._channels: list[McapChannel] = []
        #: (number of the first chunk that has it, record) of each schema and channel
        self._definitions: list[tuple[int, bytes]] = []
        self._copied: list[CopiedIndex] = []
        self._chunk_indexes: list[ChunkIndex] = []
        self._chunk = bytearray()
        self._indexes: dict[int, MessageIndex] = {}
        #: messages on the disk by channel
        self._counts: Counter[int] = Counter()
        self._append(MCAP0_MAGIC + _encoded(Header(profile, LIBRARY)))

    @property
    def span(self) -> FileSpan:
        """Number and times of the messages on the disk."""
        filled = [each for each in self._chunk_indexes if each.message_index_offsets]
        first_ns = min((each.message_start_time for each in filled), default=None)
        last_ns = max((each.message_end_time for each in filled), default=None)
        return FileSpan(self._path.name, self._counts.total(), first_ns, last_ns)

    @property
    def size(self) -> int:
        """Bytes on the disk and in the chunk that is not written yet."""
        return self._size + len(self._chunk)

    @property
    def is_open(self) -> bool:
        """Whether more can be appended."""
        return self._descriptor >= 0

    @property
    def unwritten(self) -> dict[int, int]:
        """Messages per channel that are not on the disk yet."""
        return {channel: len(index.records) for channel, index in self._indexes.items()}

    def add_channel(self, channel: Channel) -> int:
        """Declare a channel; returns its number."""
        number_of_schema = 0
        if channel.type_name or channel.schema:
            kind = (channel.type_name, channel.schema_encoding, channel.schema)
            number_of_schema = self._schemas.setdefault(kind, len(self._schemas) + 1)
            if number_of_schema > self._n_schemas:
                self._n_schemas = number_of_schema
                name, encoding, data = kind
                self._define(Schema(number_of_schema, data, encoding, name))
        number = len(self._channels) + 1
        record = McapChannel(
            number, channel.topic, channel.encoding, dict(channel.metadata), number_of_schema
        )
        self._channels.append(record)
        self._indexes[number] = MessageIndex(number, [])
        self._define(record)
        return number

    def write(
        self,
        channel: int,
        data: bytes,
        log_time_ns: int,
        publish_time_ns: int,
        sequence: int = 0,
    ) -> None:
        """Append one message to the chunk; a chunk of some size is flushed."""
        if not self._chunk:
            self._begin_chunk()
        self._indexes[channel].records.append((log_time_ns, len(self._chunk)))
        size = _FIELDS_SIZE + len(data)
        self._chunk += MESSAGE_HEAD.pack(
            _MESSAGE, size, channel, sequence, log_time_ns, publish_time_ns
        )
        self._chunk += data
        if len(self._chunk) >= _LARGEST_CHUNK:
            self.flush()

    def flush(self) -> None:
        """Append the chunk and its index to the file as one block."""
        if not self._chunk:
            return
        indexes = [index for index in self._indexes.values() if index.records]
        times = [time_ns for index in indexes for time_ns, _ in index.records]
        packed = self._compression == "zstd"
        head = Chunk(
            compression="zstd" if packed else "",
            data=b"",
            message_end_time=max(times, default=0),
            message_start_time=min(times, default=0),
            uncompressed_crc=zlib.crc32(self._chunk),
            uncompressed_size=len(self._chunk),
        )
        data = zstandard.ZstdCompressor(level=1).compress(self._chunk) if packed else self._chunk
        # The data is copied once: `mcap` would copy it three times.
        block = bytearray(_encoded(head))
        _SIZE.pack_into(block, 1, len(block) - RECORD_HEAD.size + len(data))
        _SIZE.pack_into(block, len(block) - _SIZE.size, len(data))
        block += data
        entry = entry_of_chunk(chunk_head(block), self._size, len(block))
        for index in indexes:
            entry.message_index_offsets[index.channel_id] = self._size + len(block)
            block += _encoded(index)
        entry.message_index_length = len(block) - entry.chunk_length
        self._append(block)
        self._chunk_indexes.append(entry)
        for index in indexes:
            self._counts[index.channel_id] += len(index.records)
            index.records.clear()
        self._chunk.clear()

    def copy_record(self, source: FileWindow, offset: int, length: int) -> None:
        """Append an attachment or metadata record of another file; `rosbag2` is left out."""
        index = copied_index(source, offset, length)
        if index.name == _METADATA_NAME and isinstance(index, MetadataIndex):
            return
        self.flush()
        index.offset = self._size
        for start in range(offset, offset + length, _BLOCK):
            self._append(source.read(start, min(_BLOCK, offset + length - start)))
        self._copied.append(index)

    def add_metadata(self, name: str, values: dict[str, str]) -> None:
        """Append a metadata record."""
        self.flush()
        record = _encoded(Metadata(name, values))
        self._copied.append(MetadataIndex(self._size, len(record), name))
        self._append(record)

    def finish(self, name: str, metadata: dict[str, str]) -> None:
        """Write the last chunk, a metadata record and the summary; close."""
        self.add_metadata(name, metadata)
        record = _encoded(DataEnd(0))
        self._append(record + self._summary(self._size + len(record)))
        self.close()

    def close(self) -> None:
        """Close the file as it is; further calls do nothing."""
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            os.close(descriptor)

    def _append(self, block: bytes | bytearray) -> None:
        """Append the block; on BagError (disk full, ...) no part of it stays."""
        with disk_errors("write", self._path, BagError):
            try:
                rest = memoryview(block)
                while rest:
                    rest = rest[os.write(self._descriptor, rest) :]
                if self._sync:
                    os.fdatasync(self._descriptor)
            except OSError:
                # Where even this fails, the reader finds the last whole block by itself.
                with contextlib.suppress(OSError):
                    os.ftruncate(self._descriptor, self._size)
                    os.lseek(self._descriptor, self._size, os.SEEK_SET)
                raise
        self._size += len(block)

    def _define(self, record: Schema | McapChannel) -> None:
        if not self._chunk:
            self._begin_chunk()
        encoded = _encoded(record)
        self._definitions.append((len(self._chunk_indexes), encoded))
        self._chunk += encoded

    def _begin_chunk(self) -> None:
        """Repeat the definitions that are due."""
        number = len(self._chunk_indexes)
        for first, record in self._definitions:
            age = number - first
            if age <= _REPEATED_AT_ONCE or age & (age - 1) == 0:
                self._chunk += record

    def _summary(self, start: int) -> bytes:
        """All records from `start` to the end of the file."""
        attachments = [each for each in self._copied if isinstance(each, AttachmentIndex)]
        metadata = [each for each in self._copied if isinstance(each, MetadataIndex)]
        span = self.span
        statistics = Statistics(
            attachment_count=len(attachments),
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=len(self._chunk_indexes),
            message_count=span.n_messages,
            message_end_time=span.last_ns or 0,
            message_start_time=span.first_ns or 0,
            metadata_count=len(metadata),
            schema_count=len(self._schemas),
        )
        schemas = [
            Schema(number, kind[2], kind[1], kind[0]) for kind, number in self._schemas.items()
        ]
        groups: tuple[Sequence[McapRecord], ...] = (
            *(schemas, self._channels, [statistics]),
            *(self._chunk_indexes, attachments, metadata),
        )
        summary, offsets = bytearray(), []
        for records in groups:
            group = b"".join(map(_encoded, records))
            if group:
                offsets.append(SummaryOffset(group[0], start + len(summary), len(group)))
            summary += group
        offset_start = start + len(summary)
        summary += b"".join(map(_encoded, offsets))
        unchecked = _encoded(Footer(start, offset_start, 0))[:-4]
        checksum = zlib.crc32(unchecked, zlib.crc32(summary))
        return bytes(summary) + _encoded(Footer(start, offset_start, checksum)) + MCAP0_MAGIC


def _encoded(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]
