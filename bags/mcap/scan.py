"""All messages of one MCAP file, sound or damaged, in the order they were written.

Reads record by record, unpacking messages itself, for which the reader of `mcap` takes more than
twice as long. Every checksum of the file is compared with what it covers. Where the chain of
records is broken, reading continues at the next chunk in the summary, or without one at the next
bytes that begin like a chunk. Each kind of fault becomes a Damage.
"""

import struct
from bisect import bisect_right
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from mcap.opcode import Opcode
from mcap.stream_reader import MAGIC_SIZE
from mcap.writer import MCAP0_MAGIC

from bags.damage import Damage, DamageLog
from bags.errors import BagError
from bags.limits import LARGEST_CONTENT, most_records, most_unpacked
from bags.mcap.attachments import check_record
from bags.mcap.chunks import CHUNK_PATTERN, LONGEST_HEAD, ChunkHead, chunk_head, unpack_chunk
from bags.mcap.definitions import DEFINITIONS
from bags.mcap.file_end import FileEnd
from bags.mcap.message_index import ENTRY_SIZE, INDEX_HEAD_SIZE, MessageIndexes, entries_end
from bags.mcap.records import MESSAGE_HEAD, RECORD_HEAD
from bags.mcap.window import FileWindow
from bags.topic import RawMessage, Topic
from storage.errors import disk_error

_CHUNK, _MESSAGE = int(Opcode.CHUNK), int(Opcode.MESSAGE)
_IN_RUNS = (_MESSAGE, *DEFINITIONS)
_MOST_COPIED = 100_000
_COPIED = (int(Opcode.ATTACHMENT), int(Opcode.METADATA))
_LAST_OPCODE = int(Opcode.DATA_END)
#: More bytes than this after the fields of an empty chunk are its records, not an extension.
_LARGEST_EXTENSION = 1024
_CHECKSUM = struct.Struct("<I")
_TOO_MANY = "it has more records than a file of its size can have"


class _Area(NamedTuple):
    """Bytes from `start` to `end` of a block that are records.

    is_chunk: all of them; is_torn: the last one may be cut off.
    """

    block: bytes
    start: int
    end: int
    is_chunk: bool = True
    is_torn: bool = False


class McapScan:
    """One pass through one file; `damage` and `counts` are complete after `messages`.

    expected: number of messages by the summary, None without one.
    copied: (offset, length) of each sound attachment and metadata record.
    thorough: compare the index behind each chunk with the chunk.
    size: of the file as it was recorded, which limits what is read; None for its size here.
    """

    def __init__(self, path: Path, *, thorough: bool = False, size: int | None = None) -> None:
        self.path = path
        self.copied: list[tuple[int, int]] = []
        self._log = DamageLog(path)
        self._end = FileEnd(path)
        self._definitions = self._end.definitions
        self.expected = self._end.expected
        self._counts: defaultdict[int, int] = defaultdict(int)
        self._indexes = MessageIndexes() if thorough else None
        self._recorded_size = size
        self._looks_back = True

    @property
    def damage(self) -> list[Damage]:
        """Each kind of fault that was found."""
        return self._log.damage

    @property
    def counts(self) -> Counter[str]:
        """Readable messages by topic."""
        found: Counter[str] = Counter()
        for number, count in self._counts.items():
            found[self._definitions.channels[number].topic] += count
        return found

    def topics(self) -> list[Topic]:
        """Topics by the summary; where it is brief or missing, by the whole file."""
        if not self._end.names_all_topics:
            for _ in self.messages(frozenset()):
                pass
        return self._definitions.topics()

    def messages(self, topics: frozenset[str] | None = None) -> Iterator[RawMessage]:
        """Messages of the given topics, None for all."""
        try:
            with self.path.open("rb", buffering=0) as stream:
                window = FileWindow(stream)
                self._begin(window)
                for area in self._areas(window):
                    yield from self._messages(area, topics)
                    del area  # before the next one is read
                self._compare_with_end()
        except OSError as error:
            raise BagError(str(disk_error("read", self.path, error))) from None

    def _begin(self, window: FileWindow) -> None:
        size = window.size if self._recorded_size is None else self._recorded_size
        self._n_records, self._n_unpacked = most_records(size), most_unpacked(size)
        self._n_tried = 2 * window.size + LARGEST_CONTENT
        self._limit = window.size if self._end.data_limit is None else self._end.data_limit
        self._offset, self._sound_end, self._chunk_end = MAGIC_SIZE, 0, 0
        self._ended = self._is_guess = False
        self.copied.clear()
        self._visited: set[int] = set()
        self._looked_in: _Area | None = None
        self._check_beginning(window)

    def _check_beginning(self, window: FileWindow) -> None:
        head = window.read(0, MAGIC_SIZE + 1)
        magic, opcode = head[:MAGIC_SIZE], head[MAGIC_SIZE:]
        if not head:
            self._note("the file is empty")
        elif magic != MCAP0_MAGIC:
            expected, got = MCAP0_MAGIC.hex(" "), magic.hex(" ")
            self._note(f"an MCAP file begins with {expected}, this with {got}")
            if opcode != bytes([Opcode.HEADER]):
                self._offset = self._next_chunk(window)
        elif opcode and opcode[0] in range(Opcode.HEADER + 1, _LAST_OPCODE + 1):
            self._note("the first record must be a header")

    def _areas(self, window: FileWindow) -> Iterator[_Area]:
        """Chunks, and blocks that begin with messages or definitions outside of chunks."""
        while not self._ended and self._offset + RECORD_HEAD.size <= self._limit:
            self._n_records -= 1
            if self._n_records <= 0:
                self._stop(_TOO_MANY)
                return
            block, at = window.locate(self._offset, RECORD_HEAD.size)
            opcode, length = RECORD_HEAD.unpack_from(block, at)
            if not self._is_chained(opcode, length):
                yield from self._after_break(window, opcode, length)
            elif opcode == _CHUNK:
                yield from self._chunk(window, length)
            elif opcode != Opcode.MESSAGE_INDEX and self._is_index(window, length):
                self._note("the opcode of a message index is wrong")
                self._offset = self._chunk_end = self._offset + RECORD_HEAD.size + length
            elif opcode in _IN_RUNS:
                yield from self._run(window, length)
            else:
                self._other(window, opcode, length)
        self._check_index()

    def _is_chained(self, opcode: int, length: int) -> bool:
        """Whether a record can begin here that ends before the next chunk of the summary."""
        starts = self._end.chunk_starts
        following = bisect_right(starts, self._offset)
        end = self._offset + RECORD_HEAD.size + length
        if following and starts[following - 1] == self._offset and opcode != _CHUNK:
            return False
        limit = starts[following] if following < len(starts) else self._limit
        return opcode not in (0, Opcode.FOOTER) and end <= min(limit, self._limit)

    def _after_break(self, window: FileWindow, opcode: int, length: int) -> Iterator[_Area]:
        """What is read where no record can begin."""
        if opcode == _CHUNK:
            yield from self._chunk(window, length)
            return
        offset, beyond = self._offset, self._offset + RECORD_HEAD.size + length > self._limit
        head = window.read(offset, RECORD_HEAD.size).hex(" ")
        following = self._next_chunk(window)
        if beyond and opcode and following == self._limit:
            self._note(f"the file ends within a record of {length} bytes")
        else:
            self._note(f"no record begins with {head}")
        self._offset = following

    def _next_chunk(self, window: FileWindow) -> int:
        """The next chunk of the summary, or what begins like one; the end where there is none."""
        starts = self._end.chunk_starts
        if starts:
            self._sound_end = max(self._sound_end, self._offset + 1)
            index = bisect_right(starts, self._sound_end - 1)
            return starts[index] if index < len(starts) else self._limit
        self._is_guess = True
        found = window.search(CHUNK_PATTERN, self._sound_end, LONGEST_HEAD)
        return self._limit if found is None or found >= self._limit else found

    def _chunk(self, window: FileWindow, length: int) -> Iterator[_Area]:
        self._check_index()
        offset, end = self._offset, self._offset + RECORD_HEAD.size + length
        is_guess, self._is_guess = self._is_guess, False
        self._visited.add(offset)
        try:
            head = chunk_head(window.read(offset, LONGEST_HEAD))
            if end > self._limit and self._is_torn(head) and not (is_guess or self._end.complete):
                self._note(f"the file ends within a record of {length} bytes")
                yield self._torn(window, head)
                self._offset = self._limit
                return
            area = self._records_of(window, head, length, is_guess)
        except BagError as error:
            self._note(str(error))
            self._sound_end = max(self._sound_end, offset + 1)
            if self._n_tried > 0 and (is_guess or not self._begins_record(window, end)):
                self._offset = self._next_chunk(window)
            else:
                self._offset = min(end, self._limit)
            return
        if self._indexes is not None:
            self._indexes.begin(*area[:3], self._n_records)
        yield area

    def _records_of(
        self, window: FileWindow, head: ChunkHead, length: int, is_guess: bool
    ) -> _Area:
        """The records of a sound chunk, after which the next record is sought; or BagError."""
        size, record_size = head.data_start + head.data_size, RECORD_HEAD.size + length
        fits = size <= record_size and self._offset + record_size <= self._limit
        if self._offset + size > self._limit:
            raise BagError("a chunk is longer than its record")
        if head.data_size > LARGEST_CONTENT:
            raise BagError(f"a chunk must have {LARGEST_CONTENT} bytes at most, got {size}")
        if not fits or is_guess:
            self._n_tried -= size
            if self._n_tried < 0:
                raise BagError("a chunk is longer than its record")
        if not head.data_size and record_size - size > _LARGEST_EXTENSION:
            raise BagError("the head of a chunk is damaged")
        if head.compression:
            self._n_unpacked -= head.size
            if self._n_unpacked < 0:
                self._stop("it unpacks to more than a file of its size can hold")
                raise BagError("further chunks are not read")
        records, start = unpack_chunk(head, *window.locate(self._offset, size))
        if head.compression:
            window.release()
        self._sound_end = self._offset + size
        extended = fits and size < record_size
        if not fits or (extended and self._begins_known_record(window, self._sound_end)):
            self._note("the length of a chunk record is wrong")
            self._offset = self._sound_end
        else:
            self._offset += record_size
        self._chunk_end = self._offset
        return _Area(records, start, start + head.size)

    def _is_torn(self, head: ChunkHead) -> bool:
        return self._offset + head.data_start + head.data_size > self._limit

    def _torn(self, window: FileWindow, head: ChunkHead) -> _Area:
        """What is left of the records of a chunk whose end is missing; none of a compressed one."""
        size = 0 if head.compression else min(head.size, LARGEST_CONTENT)
        block, at = window.locate(self._offset, head.data_start + size)
        start = at + head.data_start
        return _Area(block, start, max(start, min(start + size, len(block))), is_torn=True)

    def _run(self, window: FileWindow, length: int) -> Iterator[_Area]:
        """The records outside of chunks from here to the end of a block."""
        if length > LARGEST_CONTENT:
            self._note(f"a record must have {LARGEST_CONTENT} bytes at most, got {length}")
            self._offset += RECORD_HEAD.size + length
            return
        self._check_index()
        block, at = window.locate(self._offset, RECORD_HEAD.size + length)
        starts, index = self._end.chunk_starts, bisect_right(self._end.chunk_starts, self._offset)
        limit = min(self._limit, starts[index]) if index < len(starts) else self._limit
        yield _Area(block, at, min(len(block), at + limit - self._offset), False)
        self._offset = self._sound_end = self._offset + self._consumed - at

    def _other(self, window: FileWindow, opcode: int, length: int) -> None:
        """A record that holds neither messages nor definitions; unknown ones are skipped."""
        offset = self._offset
        end = offset + RECORD_HEAD.size + length
        if opcode == Opcode.MESSAGE_INDEX and length <= LARGEST_CONTENT:
            end = self._message_index(window, end)
        elif opcode == Opcode.DATA_END:
            self._ended = True
            self._check_data(window, length)
        elif opcode in _COPIED and len(self.copied) >= _MOST_COPIED:
            self._note(f"it has more than {_MOST_COPIED} attachments and metadata records")
        elif opcode in _COPIED:
            try:
                check_record(window, offset, end - offset)
                self.copied.append((offset, end - offset))
            except BagError as error:
                self._note(str(error))
        self._offset = end

    def _is_index(self, window: FileWindow, length: int) -> bool:
        """Whether the record behind a chunk or its index is an index, by all but its opcode."""
        if self._offset != self._chunk_end or (length - INDEX_HEAD_SIZE) % ENTRY_SIZE:
            return False
        start = self._offset + RECORD_HEAD.size
        return entries_end(window.read(start, INDEX_HEAD_SIZE)) == length

    def _message_index(self, window: FileWindow, end: int) -> int:
        """Where the record ends."""
        start = self._offset + RECORD_HEAD.size
        content = window.read(start, end - start)
        entries = entries_end(content)
        if entries > len(content):
            self._note("a message index is longer than its record")
            return end
        if self._indexes is not None:
            self._indexes.add(content)
        self._sound_end = start + entries
        if entries < len(content) and self._begins_known_record(window, start + entries):
            self._note("the length of a message index is wrong")
            end = start + entries
        self._chunk_end = end
        return end

    def _check_index(self) -> None:
        if self._indexes is not None and not self._indexes.fit():
            self._note("the message index before this does not fit its chunk")

    def _check_data(self, window: FileWindow, length: int) -> None:
        """Compare the checksum in the record at the end of the data with all before it."""
        end = self._offset
        if length < _CHECKSUM.size:
            self._note("the record at the end of the data is shorter than its fields")
        elif not self._log:
            (checksum,) = _CHECKSUM.unpack(window.read(end + RECORD_HEAD.size, _CHECKSUM.size))
            if checksum and window.checksum(0, end) != checksum:
                self._note("the checksum of the data does not fit")

    def _begins_record(self, window: FileWindow, offset: int) -> bool:
        """Whether the data ends here, or a record can begin."""
        head = window.read(offset, RECORD_HEAD.size) if offset <= self._limit else b""
        if offset == self._limit or len(head) < RECORD_HEAD.size:
            return offset == self._limit
        opcode, length = RECORD_HEAD.unpack(head)
        end: int = offset + RECORD_HEAD.size + length
        return opcode != 0 and end <= self._limit

    def _begins_known_record(self, window: FileWindow, offset: int) -> bool:
        if not self._begins_record(window, offset) or offset == self._limit:
            return False
        opcode, length = RECORD_HEAD.unpack(window.read(offset, RECORD_HEAD.size))
        following = offset + RECORD_HEAD.size + length
        return bool(opcode <= _LAST_OPCODE and self._begins_record(window, following))

    def _messages(self, area: _Area, topics: frozenset[str] | None) -> Iterator[RawMessage]:
        """Messages in an area, whose definitions are collected."""
        unpack_message, message_size = MESSAGE_HEAD.unpack_from, MESSAGE_HEAD.size
        counts, names = self._counts, dict[int, tuple[str, str] | None]()
        block, offset, end, is_chunk, is_torn = area
        left, n_unknown = self._n_records, 0
        for left in range(self._n_records - 1, -1, -1):  # noqa: B007 (what is left after it)
            if offset + message_size > end or block[offset] != _MESSAGE:
                following = self._skip(area, offset)
                if following is None:
                    break
                offset = following
                continue
            _, length, number, _, log_time, publish_time = unpack_message(block, offset)
            start, following = offset + message_size, offset + RECORD_HEAD.size + length
            if not start <= following <= end:
                if following > end:
                    break
                self._note("a message is shorter than its fields")
                offset = following
                continue
            offset = following
            if number not in names:
                if not self._is_defined(area, number):
                    n_unknown += 1
                    continue
                topic, type_name = self._definitions.names(number)
                wanted = topics is None or topic in topics
                names[number] = (topic, type_name) if wanted else None
            counts[number] += 1
            name = names[number]
            if name is not None:
                yield RawMessage(*name, block[start:offset], log_time, publish_time)
        self._n_records, self._consumed = left, offset
        if is_chunk and offset < end:
            if left and not is_torn:
                self._note("a record is longer than its chunk")
            elif not left:
                self._stop(_TOO_MANY)
        if n_unknown:
            self._note(f"{n_unknown} messages are of topics declared in a part that is lost")

    def _skip(self, area: _Area, offset: int) -> int | None:
        """The end of a record that is no message; None where it is not in the area."""
        if offset + RECORD_HEAD.size > area.end:
            return None
        opcode, length = RECORD_HEAD.unpack_from(area.block, offset)
        start = offset + RECORD_HEAD.size
        following = int(start + length)
        if following > area.end or not (area.is_chunk or opcode in _IN_RUNS):
            return None
        if opcode == _MESSAGE and following < offset + MESSAGE_HEAD.size:
            self._note("a message is shorter than its fields")
        elif opcode in DEFINITIONS:
            fault = self._definitions.add(opcode, area.block[start:following])
            if fault:
                self._note(fault)
        return following

    def _is_defined(self, area: _Area, number: int) -> bool:
        """Whether a channel is known, if need be from the rest of its chunk or of the file."""
        channels = self._definitions.channels
        if number not in channels and area.is_chunk and area is not self._looked_in:
            self._looked_in = area
            offset: int | None = area.start
            while offset is not None:
                offset = self._skip(area, offset)
        if number not in channels and self._looks_back:
            self._looks_back = False
            other = McapScan(self.path, size=self._recorded_size)
            other._looks_back = False
            for _ in other.messages(frozenset()):
                pass
            self._definitions.complete(other._definitions)
        return number in channels

    def _compare_with_end(self) -> None:
        if not self._ended and not self._log:
            complete = "the data has no end record"
            cut = "the file has no end: the recording was cut off here"
            self._note(complete if self._end.complete else cut)
        if self._ended and not self._end.complete:
            self._note("the summary at the end of the file is damaged")
        for each in self._end.faults.damage:
            self._note(each.what)
        self._compare_counts()

    def _compare_counts(self) -> None:
        statistics, found = self._end.statistics, sum(self._counts.values())
        n_missing = len(set(self._end.chunk_starts) - self._visited)
        if n_missing:
            self._note(f"{n_missing} chunks of the summary are missing")
        if statistics is None:
            return
        if statistics.message_count != found:
            self._note(f"{statistics.message_count} messages were written, {found} are readable")
        elif not self._log:
            self._compare_topics(statistics.channel_message_counts)
        n_copied = statistics.attachment_count + statistics.metadata_count
        if n_copied > len(self.copied):
            self._note(
                f"{n_copied} attachments and metadata records were written,"
                f" {len(self.copied)} are there"
            )

    def _compare_topics(self, counts: dict[int, int]) -> None:
        """Compare each topic with the statistics, where they count topics."""
        for number, channel in self._definitions.channels.items() if counts else ():
            written, found = counts.get(number, 0), self._counts[number]
            if written != found:
                self._note(f"{written} messages were written on {channel.topic}, {found} are there")

    def _stop(self, what: str) -> None:
        """Read no further."""
        self._note(f"{what}; the rest is not read")
        self._offset = self._limit

    def _note(self, what: str) -> None:
        self._log.note(self._offset, what)
