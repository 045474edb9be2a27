"""The data section of an MCAP file: chunks and runs of other records, up to its end.

Every checksum is compared with what it covers. Where the chain of records is broken, reading
continues at the next chunk in the summary, or without one at the next bytes that begin like one.
A place that the summary names counts only where a chunk of the listed length begins there.
"""

import re
import struct
from array import array
from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from contextlib import ExitStack
from typing import NamedTuple

import numpy as np
from mcap.opcode import Opcode
from mcap.records import ChunkIndex
from mcap.stream_reader import MAGIC_SIZE
from mcap.writer import MCAP0_MAGIC
from numpy.typing import NDArray

from serd_bag.damage import FileScan
from serd_bag.errors import BagError
from serd_bag.formats.limits import LARGEST_CONTENT, LARGEST_MESSAGE, MOST_PACKED, most_records
from serd_bag.formats.mcap.chunks import (
    CHUNK_PATTERN,
    LONGEST_HEAD,
    ChunkHead,
    ChunkUnpacker,
    chunk_head,
)
from serd_bag.formats.mcap.definitions import DEFINITIONS
from serd_bag.formats.mcap.file_end import FileEnd
from serd_bag.formats.mcap.records import RECORD_HEAD, copied_index
from serd_bag.formats.mcap.summary_index import (
    ENTRY_SIZE,
    INDEX_HEAD_SIZE,
    MOST_COPIED,
    entry_of_chunk,
)
from serd_bag.formats.mcap.window import FileWindow

#: Records that an area outside of chunks can hold.
IN_AREAS = (int(Opcode.MESSAGE), *DEFINITIONS)
_CHUNK = int(Opcode.CHUNK)
_COPIED = (int(Opcode.ATTACHMENT), int(Opcode.METADATA))
_LAST_OPCODE = int(Opcode.DATA_END)
_CHECKSUM = struct.Struct("<I")
#: Bytes with which a schema, channel or message can begin, and how many records follow each other
#: where it does.
RUN_PATTERN = re.compile(rb"[\x03-\x05].{5}\0{3}", re.DOTALL)
_LEAST_RUN = 4
#: Bytes of a large chunk that are read at once.
_BLOCK = 8 << 20
#: (number of messages, 3): channel, log time, offset in the chunk
_Positions = NDArray[np.uint64]


#: Of records whose chunk has lost its head; its times exclude none.
_NO_HEAD = ChunkHead(1, 0, 0, 0, "", 0, 0)


class Area(NamedTuple):
    """Bytes from `start` to `end` of a block that are records.

    is_chunk: all of them; is_torn: the last one may be cut off; doubted: head of the damaged chunk
    that they are of.
    """

    block: bytes
    start: int
    end: int
    is_chunk: bool = True
    is_torn: bool = False
    doubted: ChunkHead | None = None


class DataSection:
    """One walk through the data section of a file.

    Where its reader has read an area, it sets n_records to the records left that may be read,
    consumed to the place in the block where it stopped, and last to that of the last record before;
    to positions, where these are not None, it adds channel, log time and offset in the area of each
    message.
    copied: (offset, length) of each sound attachment and metadata record; visited: offsets of
    chunks; ended: whether the record at the end of the data was found; has_checksums: whether all
    that was read has them.
    """

    def __init__(
        self, window: FileWindow, end: FileEnd, scan: FileScan, size: int, *, thorough: bool
    ) -> None:
        self.n_records = most_records(size)
        self.consumed = self.last = 0
        self.positions: array[int] | None = None
        self.copied: list[tuple[int, int]] = []
        self.visited: set[int] = set()
        self.ended = False
        self.has_checksums = True
        self._window, self._end, self._log, self._mark = window, end, scan.log, scan.mark
        self._thorough = thorough
        #: of the indexes behind the last chunk: entries, as many as the chunk has messages, number
        #: of all entries and of indexes; the entry of the summary that the chunk should have
        self._indexed: list[_Positions] = []
        self._n_entries = self._n_indexes = 0
        self._entry: ChunkIndex | None = None
        self._limit = window.size if end.data_limit is None else end.data_limit
        self._unpacker = ChunkUnpacker(window, self._limit, size)
        self._offset = self._sound_end = self._chunk_end = 0
        self._is_guess = False
        # Without a checksum, where a chunk would begin is no reason to doubt the records before.
        starts = end.index.starts if end.has_checksum else ()
        #: negative places of the chunks of the summary that are still ahead, the next one last
        self._later = array("q", (-start for start in reversed(starts) if start < self._limit))
        self._misses_chunks = len(self._later) < max(1, len(starts))
        self._has_chunks = bool(end.index.starts)
        self._offset = self._check_beginning()

    def note(self, what: str, *, is_harmless: bool = False) -> None:
        """Add a fault at the present place."""
        self._log.note(self._offset, what, is_harmless=is_harmless)

    def stop(self) -> None:
        """Read no further, since there are too many records."""
        what = "it has more records than a file of its size can have; the rest is not read"
        self.note(what)
        self._mark(self._offset, self._limit, "lost", what)
        self._offset = self._limit

    def _check_beginning(self) -> int:
        head = self._window.read(0, MAGIC_SIZE + 1)
        magic, opcode = head[:MAGIC_SIZE], head[MAGIC_SIZE:]
        if not head:
            self.note("the file is empty")
        elif magic != MCAP0_MAGIC:
            expected, got = MCAP0_MAGIC.hex(" "), magic.hex(" ")
            self.note(f"an MCAP file begins with {expected}, this with {got}")
            if opcode != bytes([Opcode.HEADER]):
                return 0
        elif opcode and opcode[0] in range(Opcode.HEADER + 1, _LAST_OPCODE + 1):
            self.note("the first record must be a header")
        return MAGIC_SIZE

    def areas(self) -> Iterator[Area]:
        """Chunks, and blocks that begin with messages or definitions outside of chunks."""
        while not self.ended and self._offset + RECORD_HEAD.size <= self._limit:
            self.n_records -= 1
            if self.n_records <= 0:
                self.stop()
                return
            block, at = self._window.locate(self._offset, RECORD_HEAD.size)
            opcode, length = RECORD_HEAD.unpack_from(block, at)
            if not self._is_chained(opcode, length):
                yield from self._after_break(opcode, length)
            elif opcode == _CHUNK:
                self._has_chunks = True
                yield from self._chunk(length)
            elif opcode != Opcode.MESSAGE_INDEX and self._is_index(length):
                self.note("the opcode of a message index is wrong", is_harmless=True)
                self._offset = self._chunk_end = self._offset + RECORD_HEAD.size + length
            elif opcode in IN_AREAS:
                yield from self._run(length)
            else:
                self._other(opcode, length)
        self._check_index()

    def _is_chained(self, opcode: int, length: int) -> bool:
        """Whether a record can begin here that ends before the next chunk of the summary."""
        end = self._offset + RECORD_HEAD.size + length
        if opcode in (0, Opcode.FOOTER) or end > self._limit:
            return False
        return self._listed_chunk(self._offset + (opcode == _CHUNK), end) is None

    def _listed_chunk(self, start: int, end: int) -> int | None:
        """Return the first chunk of the summary in [start, end) that stands in the file.

        A record of the listed length must stand there. Places before `start`, and wrong ones, are
        not tried again.
        """
        index = self._end.index
        del self._later[bisect_right(self._later, -start) :]
        while self._later and -self._later[-1] < end:
            place = -self._later[-1]
            length = int.from_bytes(self._window.read(place, RECORD_HEAD.size)[1:], "little")
            if RECORD_HEAD.size + length == index.length(bisect_left(index.starts, place)):
                return place
            self._later.pop()
            self._misses_chunks = True
        return None

    def _after_break(self, opcode: int, length: int) -> Iterator[Area]:
        """What is read where no record can begin."""
        if opcode == _CHUNK:
            yield from self._chunk(length)
            return
        offset, beyond = self._offset, self._offset + RECORD_HEAD.size + length > self._limit
        head = self._window.read(offset, RECORD_HEAD.size).hex(" ")
        following = self._next_chunk()
        if beyond and opcode and following == self._limit:
            what = f"the file ends within a record of {length} bytes"
        else:
            what = f"no record begins with {head}"
        self.note(what)
        self._mark(offset, following, "lost", what)
        if self._has_chunks:  # else it holds no records, which would have been found
            yield from self._remains(offset, following)
        self._offset = following

    def _remains(self, begin: int, end: int) -> Iterator[Area]:
        """Bytes between records, in which those of a chunk without its head may be."""
        for start in range(begin, end, LARGEST_CONTENT):
            size = min(LARGEST_CONTENT, end - start)
            if self._unpacker.may_use(size):
                block, at = self._window.locate(start, size)
                yield Area(block, at, min(len(block), at + size), is_torn=True, doubted=_NO_HEAD)

    def _next_chunk(self) -> int:
        """The next chunk of the summary, or what begins like one; the end where there is none."""
        if self._later:
            self._sound_end = max(self._sound_end, self._offset + 1)
        listed = self._listed_chunk(self._sound_end, self._limit)
        limit = self._limit if listed is None else listed
        if not self._misses_chunks:
            return limit
        found = self._window.search(CHUNK_PATTERN, self._sound_end, LONGEST_HEAD)
        if found is not None and found < limit:
            self._is_guess = True
            return found
        return limit if self._has_chunks else self._next_run(limit)

    def _next_run(self, limit: int) -> int:
        """Return where the next records follow each other, in a file without chunks."""
        place = self._sound_end
        while True:
            found = self._window.search(RUN_PATTERN, place, RECORD_HEAD.size)
            if found is None or found >= limit:
                return limit
            if self._are_records(found, _LEAST_RUN, _LAST_OPCODE):
                return found
            place = found + 1

    def _chunk(self, length: int) -> Iterator[Area]:
        self._check_index()
        offset, end = self._offset, self._offset + RECORD_HEAD.size + length
        is_guess, self._is_guess = self._is_guess, False
        self.visited.add(offset)
        head = None
        try:
            head = chunk_head(self._window.read(offset, LONGEST_HEAD))
            torn = offset + head.data_start + head.data_size > self._limit
            if end > self._limit and torn and not (is_guess or self._end.complete):
                what = f"the file ends within a record of {length} bytes"
                self.note(what)
                yield Area(*self._unpacker.remains(head, offset), is_torn=True)
                self._mark(offset, self._limit, "partly read", what)
                self._offset = self._limit
                return
            size = max(head.size, head.data_size) if head.compression else head.data_size
            if size > LARGEST_CONTENT and not (torn or is_guess):
                yield from self._large_chunk(head, end)
                return
            area = self._records_of(head, length, is_guess)
        except BagError as error:
            yield from self._damaged_chunk(head, end, is_guess, str(error))
            return
        self.positions = array("Q") if self._thorough else None
        yield area

    def _damaged_chunk(
        self, head: ChunkHead | None, end: int, is_guess: bool, fault: str
    ) -> Iterator[Area]:
        """What is left of the records of a chunk, in doubt."""
        offset = self._offset
        self.note(fault)
        remains = (b"", 0, 0) if head is None else self._unpacker.remains(head, offset)
        if remains[2] > remains[1]:
            yield Area(*remains, is_torn=True, doubted=head)
        if is_guess or self._has_chunks:
            self._sound_end = max(self._sound_end, offset + 1)
        if self._unpacker.may_use(1) and (is_guess or not self._are_records(end, 1)):
            self._offset = self._next_chunk()
        else:
            self._offset = min(end, self._limit)
        self._mark(offset, self._offset, "partly read" if remains[0] else "lost", fault)

    def _large_chunk(self, head: ChunkHead, end: int) -> Iterator[Area]:
        """The records of a chunk that is too large for memory, some megabytes at a time."""
        begin, fault = self._offset + head.data_start, ""
        with ExitStack() as stack:
            window, stop, longest = self._window, begin + head.data_size, LARGEST_MESSAGE
            if head.compression:
                file = stack.enter_context(self._unpacker.unpacked_file(head, self._offset))
                window, begin = FileWindow(file), 0
                stop, longest = window.size, max(LARGEST_CONTENT, MOST_PACKED * head.data_size)
                if stop != head.size:
                    self.note(f"a chunk must have {head.size} bytes, got {stop}")
            elif head.checksum not in (0, window.checksum(begin, stop)):
                fault = "the checksum of a chunk does not fit its content"
                self.note(fault)
                self._mark(self._offset, end, "partly read", fault)
            for place, block, first, last in _blocks_of_records(window, begin, stop, longest):
                yield Area(block, first, last, doubted=head if fault else None)
                begin = place + last - first
        if begin < stop and not fault:
            fault = "a record is longer than its chunk"
            self.note(fault)
            self._mark(self._offset, end, "partly read", fault)
        self.has_checksums &= head.checksum != 0
        self._offset = self._chunk_end = end

    def _records_of(self, head: ChunkHead, length: int, is_guess: bool) -> Area:
        """The records of a sound chunk, after which the next record is sought; or BagError."""
        declared_size = head.data_size
        head, block, begin, end = self._unpacker.unpacked(
            head, self._offset, length, is_guess=is_guess
        )
        area = Area(block, begin, end)
        if head.data_size != declared_size:
            self.note(f"the data of a chunk must have {declared_size} bytes, got {head.data_size}")
        if area.end - area.start != head.size:
            self.note(f"a chunk must have {head.size} bytes, got {area.end - area.start}")
        self.has_checksums &= head.checksum != 0
        if head.compression:
            self._window.release()
        size, record_size = head.data_start + head.data_size, RECORD_HEAD.size + length
        fits = size <= record_size and self._offset + record_size <= self._limit
        self._sound_end = self._offset + size
        extended = fits and size < record_size
        if not fits or (extended and self._are_records(self._sound_end, 2, _LAST_OPCODE)):
            self.note("the length of a chunk record is wrong", is_harmless=True)
            record_size = size
        if self._thorough:
            self._entry = entry_of_chunk(head, self._offset, record_size)
        self._offset += record_size
        self._chunk_end = self._offset
        return area

    def _run(self, length: int) -> Iterator[Area]:
        """The records outside of chunks from here to the end of a block."""
        if length > LARGEST_MESSAGE:
            what = f"a record must have {LARGEST_MESSAGE} bytes at most, got {length}"
            self.note(what)
            self._mark(self._offset, self._offset + RECORD_HEAD.size + length, "lost", what)
            self._offset += RECORD_HEAD.size + length
            return
        self._check_index()
        self.has_checksums = False
        block, at = self._window.locate(self._offset, RECORD_HEAD.size + length)
        limit = min(self._limit, self._offset + len(block) - at)
        listed = self._listed_chunk(self._offset + 1, limit)
        yield Area(block, at, at + (limit if listed is None else listed) - self._offset, False)
        # A record that is longer than it should be hides the next one.
        self._sound_end = self._offset + self.last - at + 1
        self._offset += self.consumed - at

    def _other(self, opcode: int, length: int) -> None:
        """A record that holds neither messages nor definitions; unknown ones are skipped."""
        offset = self._offset
        end = offset + RECORD_HEAD.size + length
        if opcode == Opcode.MESSAGE_INDEX and length <= LARGEST_CONTENT:
            end = self._message_index(end)
        elif opcode == Opcode.DATA_END:
            self.ended = True
            self._check_data(length)
        elif opcode in _COPIED and len(self.copied) >= MOST_COPIED:
            self.note(f"it has more than {MOST_COPIED} attachments and metadata records")
        elif opcode in _COPIED:
            try:
                copied_index(self._window, offset, end - offset, verify=True)
                self.copied.append((offset, end - offset))
            except BagError as error:
                self.note(str(error))
        self._offset = end

    def _is_index(self, length: int) -> bool:
        """Whether the record behind a chunk or its index is an index, by all but its opcode."""
        if self._offset != self._chunk_end or (length - INDEX_HEAD_SIZE) % ENTRY_SIZE:
            return False
        head = self._window.read(self._offset + RECORD_HEAD.size, INDEX_HEAD_SIZE)
        return INDEX_HEAD_SIZE + int.from_bytes(head[2:], "little") == length

    def _message_index(self, end: int) -> int:
        """Keep the entries of a message index; returns where its record ends."""
        start = self._offset + RECORD_HEAD.size
        content = self._window.read(start, end - start)
        channel, size = (int.from_bytes(part, "little") for part in (content[:2], content[2:6]))
        entries_end = start + INDEX_HEAD_SIZE + size
        if entries_end > end:
            self.note("a message index is longer than its record", is_harmless=True)
            return end
        self._n_indexes += 1
        n_entries = size // ENTRY_SIZE
        self._n_entries += n_entries
        if self.positions is not None and self._n_entries <= len(self.positions) // 3:
            entries = np.frombuffer(content, "<u8", 2 * n_entries, INDEX_HEAD_SIZE).reshape(-1, 2)
            channels = np.full(n_entries, channel, np.uint64)
            self._indexed.append(np.column_stack([channels, entries]))
        self._sound_end = entries_end
        if entries_end < end and self._are_records(entries_end, 2, _LAST_OPCODE):
            self.note("the length of a message index is wrong", is_harmless=True)
            end = entries_end
        self._chunk_end = end
        if self._entry is not None:
            self._entry.message_index_offsets[channel] = self._offset
            self._entry.message_index_length += end - self._offset
        return end

    def _check_index(self) -> None:
        """Compare the last chunk with the index behind it and with its entry in the summary."""
        entry, positions, has_index = self._entry, self.positions, self._n_indexes > 0
        if positions is not None and has_index:  # which the format leaves to the writer
            expected = np.frombuffer(positions, np.uint64).reshape(-1, 3)
            indexed = np.concatenate([expected[:0], *self._indexed])
            is_whole = self._n_entries == len(expected)
            if not (is_whole and np.array_equal(_sorted(indexed), _sorted(expected))):
                self.note("the message index before this does not fit its chunk", is_harmless=True)
        self._entry, self.positions, self._indexed = None, None, []
        self._n_entries = self._n_indexes = 0
        fault = "" if entry is None else self._end.index.fault_of_chunk(entry)
        if entry is not None and fault:
            self._log.note(entry.chunk_start_offset, fault, is_harmless=True)

    def _check_data(self, length: int) -> None:
        """Compare the checksum in the record at the end of the data with all before it."""
        end = self._offset
        if length < _CHECKSUM.size:
            self.note("the record at the end of the data is shorter than its fields")
        elif not self._log:
            (checksum,) = _CHECKSUM.unpack(
                self._window.read(end + RECORD_HEAD.size, _CHECKSUM.size)
            )
            if checksum and self._window.checksum(0, end) != checksum:
                self.note("the checksum of the data does not fit")
            self.has_checksums |= checksum != 0

    def _are_records(self, offset: int, number: int, last_opcode: int = 0xFF) -> bool:
        """Whether that many records follow each other from there on, or fewer up to the end."""
        for _ in range(number):
            if offset == self._limit:
                return True
            head = self._window.read(offset, RECORD_HEAD.size) if offset < self._limit else b""
            if len(head) < RECORD_HEAD.size:
                return False
            opcode, length = RECORD_HEAD.unpack(head)
            offset += RECORD_HEAD.size + length
            if not 0 < opcode <= last_opcode or offset > self._limit:
                return False
        return True


def _blocks_of_records(
    window: FileWindow, begin: int, end: int, longest: int
) -> Iterator[tuple[int, bytes, int, int]]:
    """(place, block, where in it whole records begin and end), up to what is no record."""
    while begin + RECORD_HEAD.size <= end:
        block, first = window.locate(begin, min(_BLOCK, end - begin))
        stop = min(len(block), first + end - begin)
        last = _end_of_records(block, first, stop)
        if last == first:
            opcode, length = RECORD_HEAD.unpack_from(block, first)
            size = RECORD_HEAD.size + length
            if not opcode or length > longest or begin + size > end:
                return
            block, first = window.locate(begin, size)
            last = first + size
        yield begin, block, first, last
        begin += last - first


def _end_of_records(block: bytes, place: int, stop: int) -> int:
    while place + RECORD_HEAD.size <= stop:
        opcode, length = RECORD_HEAD.unpack_from(block, place)
        if not opcode or place + RECORD_HEAD.size + length > stop:
            break
        place += RECORD_HEAD.size + length
    return place


def _sorted(positions: _Positions) -> _Positions:
    return positions[np.lexsort(positions.T)]
