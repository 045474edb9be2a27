"""All messages of one MCAP file, whole or damaged, in the order they were written.

Goes from record to record and trusts nothing: a chunk whose checksum does not fit is left out;
where the chain of records is broken the walk goes on at the next chunk the file's end tells of;
what was found is held against the number the file's end tells. Each fault is kept as a Damage.
"""

import os
from bisect import bisect_right
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from bags.errors import BagError
from bags.health.damage import Damage
from bags.mcap.chunk import split_messages, split_records, torn_chunk, unpacked_chunk
from bags.mcap.definitions import Channel, Definitions
from bags.mcap.ending import file_ending
from bags.mcap.format import (
    CHANNEL,
    CHUNK,
    DATA_END,
    FIRST_PRIVATE,
    FOOTER,
    HEADER,
    MAGIC,
    MESSAGE,
    MESSAGE_INDEX,
    RECORD_HEAD,
    SCHEMA,
)
from bags.mcap.index import index_fits
from storage.errors import disk_error

#: channel, log time, publish time, data
Found = tuple[Channel, int, int, bytes]


class McapScan:
    """One walk through one file; what it collects is complete after `messages`.

    counts: readable messages by topic; expected: what the end of the file tells, None without one.
    thorough: hold the index behind each chunk against the chunk.
    """

    def __init__(self, path: Path, *, thorough: bool = False) -> None:
        self.path = path
        self.damage: list[Damage] = []
        self.ending = file_ending(path)
        self.definitions = self.ending.definitions if self.ending else Definitions()
        self.expected = self.ending.n_messages if self.ending else None
        self._counts: defaultdict[int, int] = defaultdict(int)
        self._thorough = thorough
        self._chunk_records = b""
        self._indexes: list[bytes] = []
        self._offset = 0
        self._ended = False
        self._chunked = bool(self.ending and self.ending.chunk_starts)

    @property
    def counts(self) -> Counter[str]:
        """Readable messages by topic."""
        found: Counter[str] = Counter()
        for number, count in self._counts.items():
            found[self.definitions.channels[number].topic] += count
        return found

    def messages(self, topics: frozenset[str] | None = None) -> Iterator[Found]:
        """Messages of the given topics, None for all."""
        try:
            with self.path.open("rb") as stream:
                size = os.fstat(stream.fileno()).st_size
                if self._begins_well(stream, size):
                    yield from self._walk(stream, size, topics)
        except OSError as error:
            raise BagError(str(disk_error("read", self.path, error))) from None
        self._hold_against_ending()

    def _walk(self, stream: BinaryIO, size: int, topics: frozenset[str] | None) -> Iterator[Found]:
        self._offset = len(MAGIC)
        while not self._ended:
            stream.seek(self._offset)
            head = stream.read(RECORD_HEAD.size)
            if len(head) < RECORD_HEAD.size:
                return
            opcode, length = RECORD_HEAD.unpack(head)
            rest = size - self._offset - RECORD_HEAD.size
            if not _plausible(opcode) or (length > rest and self._later_chunk() is not None):
                if not self._go_on(f"no record begins with {head.hex(' ')}"):
                    return
                continue
            whole = length <= rest
            if not whole:
                self._note(f"the file ends within a record of {length} bytes")
            faults = len(self.damage)
            yield from self._record(opcode, stream.read(min(length, rest)), whole, topics)
            following = self._later_chunk() if len(self.damage) > faults else None
            step = RECORD_HEAD.size + min(length, rest)
            self._offset = self._offset + step if following is None else following

    def _record(
        self, opcode: int, content: bytes, whole: bool, topics: frozenset[str] | None
    ) -> Iterator[Found]:
        if opcode != MESSAGE_INDEX:
            self._check_index()
        if opcode == CHUNK:
            self._chunked = True
            yield from self._chunk(content, whole, topics)
        elif opcode == MESSAGE and self._chunked:
            self._note("a message stands outside the chunks")
        elif opcode == MESSAGE and whole:
            yield from self._found(RECORD_HEAD.pack(MESSAGE, len(content)) + content, topics)
        elif opcode in (SCHEMA, CHANNEL) and whole:
            self._define(opcode, content)
        elif opcode == MESSAGE_INDEX and whole:
            if int.from_bytes(content[2:6], "little") != len(content) - 6:
                self._note("a message index is longer than its fields")
            self._indexes.append(content)
        elif opcode == DATA_END:
            self._ended = True

    def _begins_well(self, stream: BinaryIO, size: int) -> bool:
        magic, opcode = stream.read(len(MAGIC)), stream.read(1)
        if magic == MAGIC:
            return True
        if size == 0:
            self._note("the file is empty")
        else:
            self._note(f"an MCAP file begins with {MAGIC.hex(' ')}, this with {magic.hex(' ')}")
        return opcode == bytes([HEADER]) and (magic[1:5] == MAGIC[1:5] or self.ending is not None)

    def _chunk(self, content: bytes, whole: bool, topics: frozenset[str] | None) -> Iterator[Found]:
        try:
            records = unpacked_chunk(content) if whole else torn_chunk(content)
        except BagError as error:
            self._note(str(error))
            return
        for opcode, start, end in split_records(records):
            if opcode in (SCHEMA, CHANNEL):
                self._define(opcode, records[start:end])
        if self._thorough:
            self._chunk_records = records
        yield from self._found(records, topics)

    def _check_index(self) -> None:
        if self._thorough and not index_fits(self._chunk_records, self._indexes):
            self._note("the message index before this does not fit its chunk")
        self._chunk_records = b""
        self._indexes.clear()

    def _found(self, records: bytes, topics: frozenset[str] | None) -> Iterator[Found]:
        channels, counts = self.definitions.channels, self._counts
        unknown = 0
        for number, log_time, publish_time, start, end in split_messages(records):
            channel = channels.get(number)
            if channel is None:
                unknown += 1
                continue
            counts[number] += 1
            if topics is None or channel.topic in topics:
                yield channel, log_time, publish_time, records[start:end]
        if unknown:
            self._note(f"{unknown} messages are of topics declared in a part that is lost")

    def _define(self, opcode: int, content: bytes) -> None:
        try:
            if opcode == SCHEMA:
                self.definitions.add_schema(content)
            else:
                self.definitions.add_channel(content)
        except BagError as error:
            self._note(str(error))

    def _later_chunk(self) -> int | None:
        starts = self.ending.chunk_starts if self.ending else ()
        index = bisect_right(starts, self._offset)
        return starts[index] if index < len(starts) else None

    def _go_on(self, what: str) -> bool:
        self._note(what)
        following = self._later_chunk()
        self._offset = self._offset if following is None else following
        return following is not None

    def _hold_against_ending(self) -> None:
        if not self._ended and not self.damage:
            self._note("the file has no end: the recording was cut off here")
        if self._ended and self.ending is None:
            self._note("the summary at the end of the file is damaged")
        found = sum(self._counts.values())
        if self.expected is not None and self.expected != found:
            self._note(f"{self.expected} messages were written, {found} are readable")
        elif self.ending is not None and not self.damage:
            self._hold_against_counts(self.ending.message_counts)

    def _hold_against_counts(self, told: dict[int, int]) -> None:
        """Each topic against the statistics, where the file has any."""
        for number, channel in self.definitions.channels.items() if told else ():
            written, found = told.get(number, 0), self._counts[number]
            if written != found:
                self._note(f"{written} messages were written on {channel.topic}, {found} are there")

    def _note(self, what: str) -> None:
        self.damage.append(Damage(self.path, self._offset, what))


def _plausible(opcode: int) -> bool:
    """A record of the data section, or one a later version may bring."""
    return (HEADER <= opcode <= DATA_END and opcode != FOOTER) or opcode >= FIRST_PRIVATE
