"""The end of an MCAP file: data end, summary and footer, read without the data before it.

The footer points to the summary. The pointer is right where the record that ends the data stands
before that place and nothing but records of a summary stands behind it.
"""

import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import Footer, Statistics
from mcap.stream_reader import MAGIC_SIZE
from mcap.writer import MCAP0_MAGIC

from serd_bag.damage import DamageLog
from serd_bag.errors import BagError, disk_errors
from serd_bag.formats.limits import LARGEST_CONTENT
from serd_bag.formats.mcap.definitions import DEFINITIONS, Definitions
from serd_bag.formats.mcap.records import RECORD_HEAD, read_record
from serd_bag.formats.mcap.summary_index import ENTRIES, SummaryIndex
from serd_bag.formats.mcap.window import FileWindow

_FOOTER_FIELDS = struct.Struct("<QQI")
_DATA_END_SIZE = 4
#: opcode, start and length of a group of records
_OFFSET_FIELDS = struct.Struct("<BQQ")
#: Bytes in which a footer or the end of the data is sought, which may be longer than its fields.
_LONGEST_END = 256
#: Opcodes of the records that no summary holds.
_OF_DATA = frozenset(
    [
        *(0, int(Opcode.HEADER), int(Opcode.FOOTER), int(Opcode.MESSAGE), int(Opcode.CHUNK)),
        *(int(Opcode.MESSAGE_INDEX), int(Opcode.ATTACHMENT), int(Opcode.METADATA)),
        int(Opcode.DATA_END),
    ]
)


class FileEnd:
    """What the end of a file holds; everything is empty where there is no sound one.

    complete: whether the file ends with a footer; has_checksum: whether the summary has one that
    fits; data_limit: byte at which the data section ends at the latest, None without a footer;
    index_faults: sentences about wrong pointers within the summary, on which no message depends.
    """

    def __init__(self, path: Path, window: FileWindow | None = None) -> None:
        self.complete = False
        self.has_checksum = False
        self.data_limit: int | None = None
        self.definitions = Definitions()
        self.statistics: Statistics | None = None
        self.index = SummaryIndex()
        self.faults = DamageLog(path)
        self.index_faults: list[str] = []
        #: where the first record behind the header begins, and the one that ends the data
        self._data = (0, 0)
        if window is not None:
            self._read(window)
            return
        with disk_errors("read", path, BagError), path.open("rb", buffering=0) as stream:
            self._read(FileWindow(stream))

    @cached_property
    def states_contents(self) -> bool:
        """Whether the summary names all topics and has the numbers and times of their messages.

        Its statistics then agree with the sizes of all message indexes, by channel, and the parts
        that it lists fill the data without a gap: nothing in the file can be missing from it.
        """
        if self.statistics is None or self.faults:
            return False
        contents, stated = self.index.contents(*self._data), self.statistics
        if contents is None:
            return False
        counts, *times_ns = contents
        return (
            +counts == +Counter(stated.channel_message_counts)
            and counts.total() == stated.message_count
            and self.definitions.have(counts)
            and times_ns == [stated.message_start_time, stated.message_end_time]
        )

    def _read(self, window: FileWindow) -> None:
        tail = window.read(max(0, window.size - _LONGEST_END), _LONGEST_END)
        at = None
        if tail.endswith(MCAP0_MAGIC):
            at = _record_before(tail[:-MAGIC_SIZE], Opcode.FOOTER, _FOOTER_FIELDS.size)
        if at is None:
            return
        self.complete = True
        footer_start = self.data_limit = window.size - len(tail) + at
        footer = read_record(Footer, tail[at + RECORD_HEAD.size :])
        start = footer.summary_start or footer_start
        size = footer_start - start
        wrong = f"the footer points to byte {start}, where no summary begins"
        if not MAGIC_SIZE <= start <= footer_start:
            self.faults.note(None, wrong)
            return
        if size > LARGEST_CONTENT:
            self.faults.note(
                None, f"a summary must have {LARGEST_CONTENT} bytes at most, got {size}"
            )
            return
        summary = window.read(start, size)
        checked = tail[at : at + RECORD_HEAD.size + _FOOTER_FIELDS.size - 4]
        if footer.summary_crc not in (0, zlib.crc32(checked, zlib.crc32(summary))):
            self.faults.note(None, "the checksum of the summary does not fit")
            return
        before = window.read(max(0, start - _LONGEST_END), min(start, _LONGEST_END))
        at = _record_before(before, Opcode.DATA_END, _DATA_END_SIZE)
        data_end = None if at is None else start - len(before) + at
        is_right, is_whole = _are_of_summary(summary)
        if data_end is None or not is_right:
            none = "the footer names no summary, but no data ends before it"
            self.faults.note(None, wrong if footer.summary_start else none)
        if not is_right or (data_end is None and not (footer.summary_crc and is_whole)):
            return
        self.data_limit = start
        self.has_checksum = footer.summary_crc != 0
        (header_size,) = struct.unpack_from("<Q", window.read(MAGIC_SIZE + 1, 8).ljust(8, b"\0"))
        self._data = (MAGIC_SIZE + RECORD_HEAD.size + header_size, data_end or 0)
        self.index = SummaryIndex(summary)
        for record in _records(summary):
            self._collect(summary, *record)
        self._check_offsets(summary, start, footer)

    def _collect(self, summary: bytes, opcode: int, begin: int, end: int) -> None:
        """Keep a record of the summary; one that is damaged does not concern the others."""
        if end > len(summary):
            self.faults.note(None, "a record of the summary is cut off")
            return
        content, fault = summary[begin:end], ""
        try:
            if opcode in DEFINITIONS:
                fault = self.definitions.add(opcode, content)
            elif opcode in ENTRIES:
                self.index.add(opcode, begin, end)
            elif opcode == Opcode.STATISTICS and self.statistics is None:
                self.statistics = read_record(Statistics, content)
        except BagError as error:
            fault = str(error)
        if fault:
            self.faults.note(None, f"in the summary, {fault}")

    def _check_offsets(self, summary: bytes, start: int, footer: Footer) -> None:
        """Compare the summary's offsets with the groups of records that they point to."""
        groups: dict[int, list[int]] = {}
        for opcode, begin, end in _records(summary):
            group = groups.setdefault(opcode, [start + begin - RECORD_HEAD.size, 0])
            group[1] += RECORD_HEAD.size + end - begin
        none = (0, start + len(summary))
        offsets = groups.get(int(Opcode.SUMMARY_OFFSET))
        if footer.summary_offset_start not in (none if offsets is None else offsets[:1]):
            self.index_faults.append(
                f"the footer points to byte {footer.summary_offset_start}, where no offsets of the"
                " summary begin"
            )
        listed = (
            _OFFSET_FIELDS.unpack_from(summary, begin)
            for opcode, begin, end in _records(summary)
            if opcode == Opcode.SUMMARY_OFFSET and _OFFSET_FIELDS.size <= end - begin
        )
        if any(groups.get(opcode, [place[0], 0]) != place for opcode, *place in listed):
            self.index_faults.append("an offset of the summary does not point to its records")


def ends_with_footer(content: bytes) -> bool:
    """Whether the bytes before the last magic number end with a footer."""
    return _record_before(content, Opcode.FOOTER, _FOOTER_FIELDS.size) is not None


def _records(summary: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield opcode, begin and end of the content of each record; the last one may be cut off."""
    offset = 0
    while offset + RECORD_HEAD.size <= len(summary):
        opcode, length = RECORD_HEAD.unpack_from(summary, offset)
        begin = offset + RECORD_HEAD.size
        offset = begin + length
        yield opcode, begin, offset


def _are_of_summary(summary: bytes) -> tuple[bool, bool]:
    """Return whether no record is one of the data section, and whether no record is cut off."""
    place = 0
    for opcode, _, end in _records(summary):
        if opcode in _OF_DATA:
            return False, False
        place = end
    return True, place == len(summary)


def _record_before(content: bytes, opcode: int, least: int) -> int | None:
    """Return where the record of this opcode begins that ends with the content, if one does.

    least: bytes of its fields; later versions of the format may add some.
    """
    for size in range(least, len(content) - RECORD_HEAD.size + 1):
        at = len(content) - size - RECORD_HEAD.size
        if RECORD_HEAD.unpack_from(content, at) == (opcode, size):
            return at
    return None
