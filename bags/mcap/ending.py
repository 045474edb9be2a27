"""The end of an MCAP file, read and checked: what should be in the file, and where."""

import os
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from bags.errors import BagError
from bags.mcap.chunk import split_records
from bags.mcap.definitions import Definitions
from bags.mcap.format import (
    CHANNEL,
    CHUNK_INDEX,
    FOOTER,
    FOOTER_CONTENT,
    FOOTER_SIZE,
    MAGIC,
    RECORD_HEAD,
    SCHEMA,
    STATISTICS,
    STATISTICS_HEAD,
    Cursor,
)
from storage.errors import disk_error


@dataclass(frozen=True)
class Ending:
    """n_messages: None where the file does not say; message_counts: by channel, may be empty."""

    definitions: Definitions
    chunk_starts: tuple[int, ...]
    n_messages: int | None
    message_counts: dict[int, int]

    @property
    def names_topics(self) -> bool:
        """Whether it repeats the channels of the file; the format leaves that to the writer."""
        known = self.definitions.channels
        return bool(known or self.n_messages == 0) and known.keys() >= self.message_counts.keys()


def file_ending(path: Path) -> Ending | None:
    """The ending of the file, None where there is no whole and sound one."""
    try:
        with path.open("rb") as stream:
            return _ending(stream)
    except OSError as error:
        raise BagError(str(disk_error("read", path, error))) from None
    except (BagError, struct.error, UnicodeError):
        return None


def _ending(stream: BinaryIO) -> Ending | None:
    size = os.fstat(stream.fileno()).st_size
    tail_start = size - FOOTER_SIZE - len(MAGIC)
    if tail_start < len(MAGIC):
        return None
    stream.seek(tail_start)
    tail = stream.read()
    if not tail.endswith(MAGIC) or RECORD_HEAD.unpack_from(tail)[0] != FOOTER:
        return None
    summary_start, _, checksum = FOOTER_CONTENT.unpack_from(tail, RECORD_HEAD.size)
    if not len(MAGIC) <= summary_start <= tail_start:
        return None
    stream.seek(summary_start)
    summary = stream.read(tail_start - summary_start)
    footer = tail[: RECORD_HEAD.size + FOOTER_CONTENT.size - 4]
    if checksum and zlib.crc32(footer, zlib.crc32(summary)) != checksum:
        return None
    return _parsed(summary)


def _parsed(summary: bytes) -> Ending:
    definitions, starts = Definitions(), []
    statistics: tuple[int, ...] | None = None
    counts: dict[int, int] = {}
    for opcode, start, end in split_records(summary):
        content = summary[start:end]
        if opcode == SCHEMA:
            definitions.add_schema(content)
        elif opcode == CHANNEL:
            definitions.add_channel(content)
        elif opcode == CHUNK_INDEX:
            starts.append(Cursor(content).numbers("QQQ")[2])
        elif opcode == STATISTICS:
            statistics = STATISTICS_HEAD.unpack_from(content)
            counts = dict(struct.iter_unpack("<HQ", content[STATISTICS_HEAD.size + 4 :]))
    n_messages = statistics[0] if statistics else None
    return Ending(definitions, tuple(sorted(starts)), n_messages, counts)
