"""What the end of an MCAP file says of the rest: schemas, channels, indexes, statistics."""

import zlib
from dataclasses import dataclass, field

from bags.mcap.format import (
    CHANNEL,
    CHUNK_INDEX,
    DATA_END,
    FOOTER,
    FOOTER_CONTENT,
    MAGIC,
    METADATA_INDEX,
    RECORD_HEAD,
    SCHEMA,
    STATISTICS,
    STATISTICS_HEAD,
    SUMMARY_OFFSET,
    record,
    text,
)


@dataclass
class SummaryBuilder:
    """Collects, while a file is written, what its end must repeat; contents of whole records."""

    schemas: list[bytes] = field(default_factory=list)
    channels: list[bytes] = field(default_factory=list)
    chunk_indexes: list[bytes] = field(default_factory=list)
    metadata_indexes: list[bytes] = field(default_factory=list)
    message_counts: dict[int, int] = field(default_factory=dict)
    n_messages: int = 0
    first_ns: int = 0
    last_ns: int = 0

    def count(self, channel: int, log_time_ns: int) -> None:
        """Take note of one message."""
        first = not self.n_messages
        self.first_ns = log_time_ns if first else min(self.first_ns, log_time_ns)
        self.last_ns = log_time_ns if first else max(self.last_ns, log_time_ns)
        self.message_counts[channel] += 1
        self.n_messages += 1

    def ending(self, start: int) -> bytes:
        """All that follows the data section; `start` is the offset at which it is written."""
        data_end = record(DATA_END, b"\0\0\0\0")
        summary_start = start + len(data_end)
        summary, offsets = bytearray(), bytearray()
        for opcode, contents in self._groups():
            group = b"".join(record(opcode, content) for content in contents)
            if group:
                where = _numbers(8, summary_start + len(summary)) + _numbers(8, len(group))
                offsets += record(SUMMARY_OFFSET, bytes([opcode]) + where)
            summary += group
        offset_start = summary_start + len(summary)
        summary += offsets
        footer = RECORD_HEAD.pack(FOOTER, FOOTER_CONTENT.size)
        footer += _numbers(8, summary_start) + _numbers(8, offset_start)
        checksum = zlib.crc32(footer, zlib.crc32(summary))
        return data_end + bytes(summary) + footer + _numbers(4, checksum) + MAGIC

    def _groups(self) -> tuple[tuple[int, list[bytes]], ...]:
        return (
            (SCHEMA, self.schemas),
            (CHANNEL, self.channels),
            (STATISTICS, [self._statistics()]),
            (CHUNK_INDEX, self.chunk_indexes),
            (METADATA_INDEX, self.metadata_indexes),
        )

    def _statistics(self) -> bytes:
        head = STATISTICS_HEAD.pack(
            self.n_messages,
            len(self.schemas),
            len(self.channels),
            0,
            len(self.metadata_indexes),
            len(self.chunk_indexes),
            self.first_ns,
            self.last_ns,
        )
        counts = (_numbers(2, key) + _numbers(8, n) for key, n in self.message_counts.items())
        return head + text(b"".join(counts))


def _numbers(size: int, value: int) -> bytes:
    return value.to_bytes(size, "little")
