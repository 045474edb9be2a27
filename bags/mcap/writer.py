"""One MCAP file, written in small checked chunks, each appended whole.

Schemas and channels stand in the chunks (under their checksums) and again in the summary.
"""

import struct
import zlib
from collections import defaultdict
from pathlib import Path
from typing import Literal

import zstandard

from bags.mcap.disk_file import DiskFile
from bags.mcap.format import (
    CHANNEL,
    CHUNK,
    CHUNK_HEAD,
    HEADER,
    MAGIC,
    MESSAGE,
    MESSAGE_HEAD,
    MESSAGE_INDEX,
    MESSAGE_RECORD_HEAD,
    METADATA,
    RECORD_HEAD,
    SCHEMA,
    record,
    text,
    text_map,
)
from bags.mcap.summary import SummaryBuilder
from bags.rosbag2.message_types import MessageType
from bags.rosbag2.qos import qos_yaml
from bags.rosbag2.topic import Topic

Compression = Literal["none", "zstd"]
PROFILE = "ros2"
LIBRARY = "serd"
_LARGEST_CHUNK = 256 * 1024


class McapWriter:
    """Appends messages to one file; what `flush` has written survives the death of the process."""

    def __init__(self, path: Path, *, compression: Compression = "none", sync: bool = False):
        self.summary = SummaryBuilder()
        self._file = DiskFile(path, sync=sync)
        self._compression = compression
        self._schema_ids: dict[MessageType, int] = {}
        self._chunk = bytearray()
        self._index: dict[int, list[tuple[int, int]]] = defaultdict(list)
        self._file.append(MAGIC + record(HEADER, text(PROFILE) + text(LIBRARY)))

    @property
    def size(self) -> int:
        """Bytes on the disk and in the chunk that is not written yet."""
        return self._file.size + len(self._chunk)

    @property
    def is_open(self) -> bool:
        """Whether more can be appended."""
        return self._file.is_open

    @property
    def unwritten(self) -> dict[int, int]:
        """Messages per channel that are not on the disk yet."""
        return {channel: len(entries) for channel, entries in self._index.items()}

    def add_topic(self, topic: Topic) -> int:
        """Declare a topic; returns its channel number."""
        schema_id = self._schema_ids.get(topic.message_type) or self._add_schema(topic.message_type)
        channel = len(self.summary.channels) + 1
        metadata = {
            "offered_qos_profiles": qos_yaml(topic.qos),
            "topic_type_hash": topic.message_type.type_hash,
        }
        content = struct.pack("<HH", channel, schema_id)
        content += text(topic.name) + text("cdr") + text_map(metadata)
        self.summary.channels.append(content)
        self.summary.message_counts[channel] = 0
        self._chunk += record(CHANNEL, content)
        return channel

    def write(self, channel: int, data: bytes, log_time_ns: int, publish_time_ns: int) -> None:
        """Append one message to the chunk; a chunk of some size is flushed."""
        self._index[channel].append((log_time_ns, len(self._chunk)))
        size = MESSAGE_HEAD.size + len(data)
        self._chunk += MESSAGE_RECORD_HEAD.pack(
            MESSAGE, size, channel, 0, log_time_ns, publish_time_ns
        )
        self._chunk += data
        self.summary.count(channel, log_time_ns)
        if len(self._chunk) >= _LARGEST_CHUNK:
            self.flush()

    def flush(self) -> None:
        """Put the chunk on the disk."""
        if not self._chunk:
            return
        times = [time for entries in self._index.values() for time, _ in entries] or [0]
        first, last = min(times), max(times)
        packed = self._packed()
        head = CHUNK_HEAD.pack(first, last, len(self._chunk), zlib.crc32(self._chunk))
        name = text("" if self._compression == "none" else self._compression)
        content = head + name + struct.pack("<Q", len(packed)) + packed
        chunk = record(CHUNK, content)
        indexes, offsets = self._message_indexes(self._file.size + len(chunk))
        span = struct.pack("<QQQQ", first, last, self._file.size, len(chunk))
        sizes = struct.pack("<QQ", len(packed), len(self._chunk))
        entry = span + text(offsets) + struct.pack("<Q", len(indexes)) + name + sizes
        self._file.append(chunk + indexes)
        self.summary.chunk_indexes.append(entry)
        self._chunk.clear()
        self._index.clear()

    def finish(self, metadata: dict[str, str]) -> None:
        """Write the last chunk, the metadata record `rosbag2` and the summary; close."""
        self.flush()
        content = text("rosbag2") + text_map(metadata)
        entry = struct.pack("<QQ", self._file.size, RECORD_HEAD.size + len(content))
        self.summary.metadata_indexes.append(entry + text("rosbag2"))
        kept = record(METADATA, content)
        self._file.append(kept + self.summary.ending(self._file.size + len(kept)))
        self.close()

    def close(self) -> None:
        """Close the file as it is."""
        self._file.close()

    def _add_schema(self, message_type: MessageType) -> int:
        schema_id = len(self._schema_ids) + 1
        self._schema_ids[message_type] = schema_id
        content = struct.pack("<H", schema_id) + text(message_type.name)
        content += text(message_type.encoding) + text(message_type.text)
        self.summary.schemas.append(content)
        self._chunk += record(SCHEMA, content)
        return schema_id

    def _packed(self) -> bytes:
        if self._compression == "none":
            return bytes(self._chunk)
        return zstandard.ZstdCompressor(level=1).compress(self._chunk)

    def _message_indexes(self, start: int) -> tuple[bytes, bytes]:
        """Index records of the chunk, and where each begins."""
        indexes, offsets = bytearray(), bytearray()
        for channel, entries in self._index.items():
            offsets += struct.pack("<HQ", channel, start + len(indexes))
            packed = b"".join(struct.pack("<QQ", *entry) for entry in entries)
            indexes += record(MESSAGE_INDEX, struct.pack("<H", channel) + text(packed))
        return bytes(indexes), bytes(offsets)
