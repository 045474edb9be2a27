"""The end of an MCAP file: data end, summary and footer, read without the data before it."""

import struct
import zlib
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import Footer, Statistics
from mcap.stream_reader import MAGIC_SIZE
from mcap.writer import MCAP0_MAGIC

from bags.damage import DamageLog
from bags.errors import BagError
from bags.formats.limits import LARGEST_CONTENT
from bags.formats.mcap.definitions import DEFINITIONS, Definitions
from bags.formats.mcap.records import RECORD_HEAD, read_record
from bags.formats.mcap.window import FileWindow
from storage.errors import disk_errors

_FOOTER_FIELDS = struct.Struct("<QQI")
_LONGEST_FOOTER = 256
_CHUNK_INDEX = struct.Struct("<QQQ")


class FileEnd:
    """What the end of a file holds; everything is empty where there is no sound one.

    complete: whether the file ends with a footer; data_limit: where the data section ends at the
    latest, None where unknown; chunk_starts: sorted.
    """

    def __init__(self, path: Path) -> None:
        self.complete = False
        self.data_limit: int | None = None
        self.definitions = Definitions()
        self.statistics: Statistics | None = None
        self.chunk_starts: list[int] = []
        self.faults = DamageLog(path)
        with disk_errors("read", path, BagError), path.open("rb", buffering=0) as stream:
            self._read(FileWindow(stream))

    @property
    def names_all_topics(self) -> bool:
        """Whether the summary repeats all channels and counts their messages."""
        if self.statistics is None or self.faults:
            return False
        counted = self.statistics.channel_message_counts.keys()
        known = self.definitions.channels.keys()
        return known >= counted and bool(known or not self.statistics.message_count)

    def _read(self, window: FileWindow) -> None:
        tail = window.read(max(0, window.size - _LONGEST_FOOTER), _LONGEST_FOOTER)
        at = _footer_place(tail)
        if at is None:
            return
        self.complete = True
        footer_start = window.size - len(tail) + at
        footer = read_record(Footer, tail[at + RECORD_HEAD.size :])
        start = footer.summary_start or footer_start
        checked = tail[at : at + RECORD_HEAD.size + _FOOTER_FIELDS.size - 4]
        size = footer_start - start
        if not (MAGIC_SIZE <= start <= footer_start and size <= LARGEST_CONTENT):
            self.faults.note(None, "the footer does not fit the file")
            return
        content = window.read(start, size)
        if footer.summary_crc not in (0, zlib.crc32(checked, zlib.crc32(content))):
            self.faults.note(None, "the checksum of the summary does not fit")
            return
        self.data_limit = start
        self._collect(content)
        # Without a checksum, where a chunk would begin is no reason to doubt the records before.
        self.chunk_starts = sorted(self.chunk_starts) if footer.summary_crc else []

    def _collect(self, content: bytes) -> None:
        """The records of the summary; one that is damaged does not concern the others."""
        offset = 0
        while offset + RECORD_HEAD.size <= len(content):
            opcode, length = RECORD_HEAD.unpack_from(content, offset)
            start = offset + RECORD_HEAD.size
            offset = start + length
            if offset > len(content):
                self.faults.note(None, "a record of the summary is cut off")
            elif opcode == Opcode.CHUNK_INDEX and length >= _CHUNK_INDEX.size:
                self.chunk_starts.append(_CHUNK_INDEX.unpack_from(content, start)[2])
            elif opcode in DEFINITIONS:
                self._note(self.definitions.add(opcode, content[start:offset]))
            elif opcode == Opcode.STATISTICS and self.statistics is None:
                try:
                    self.statistics = read_record(Statistics, content[start:offset])
                except BagError as error:
                    self._note(str(error))

    def _note(self, fault: str) -> None:
        if fault:
            self.faults.note(None, f"in the summary, {fault}")


def _footer_place(tail: bytes) -> int | None:
    """Where the footer begins, which may be longer than its fields."""
    if not tail.endswith(MCAP0_MAGIC):
        return None
    end = len(tail) - MAGIC_SIZE
    for size in range(_FOOTER_FIELDS.size, end - RECORD_HEAD.size + 1):
        at = end - size - RECORD_HEAD.size
        if RECORD_HEAD.unpack_from(tail, at) == (Opcode.FOOTER, size):
            return at
    return None
