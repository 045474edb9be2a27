"""One walk through the records of a .bag file outside of chunks, which no index leads.

Where no record begins, it continues at the next bytes that begin like a chunk.
"""

import re
from collections.abc import Iterator
from typing import NamedTuple

from serd_bag.damage import DamageLog
from serd_bag.errors import BagError
from serd_bag.formats.limits import LARGEST_CONTENT
from serd_bag.formats.mcap.window import FileWindow
from serd_bag.formats.ros1.records import (
    BAG_HEADER,
    CHUNK,
    CHUNK_INFO,
    CHUNK_PATTERN,
    CONNECTION,
    INDEX,
    KINDS,
    LONGEST_CHUNK_HEAD,
    MESSAGE,
    Connection,
    Entry,
    Record,
    connection_of,
    counts_of,
    entries_of,
    header_size,
    record_at,
)

_MAGIC = re.compile(rb"#ROSBAG V(\d+)\.(\d+)\n")
_VERSION = 200
_LONGEST_MAGIC = 32
_REINDEX = "'rosbag reindex' of ROS 1 may repair it"


class Part(NamedTuple):
    """A chunk with the entries of the index behind it, or a message outside of chunks.

    place: where its record begins.
    """

    place: int
    record: Record
    entries: list[Entry]


class Walk:
    """What a walk has found, once it has ended.

    connections: outside of chunks; counts: messages by connection that the index has of each chunk,
    by its place.
    """

    def __init__(self, window: FileWindow, log: DamageLog) -> None:
        self.connections: dict[int, Connection] = {}
        self.counts: dict[int, dict[int, int]] = {}
        self._window, self._log = window, log
        self._header: Record | None = None
        self._index_start: int | None = None
        self._chunks: set[int] = set()
        self._indexed: set[int] = set()

    def parts(self) -> Iterator[Part]:
        """All chunks and messages in the order of the file."""
        offset = self._beginning()
        last = offset - 1
        while offset < self._window.size:
            try:
                record = self._record(offset)
            except BagError as error:
                self._log.note(offset, f"a chunk is damaged ({error})")
                offset = self._next_chunk(last + 1)
                last = offset - 1
                continue
            last, offset = offset, record.end
            if record.kind == CHUNK:
                self._chunks.add(last)
                record, offset = self._sized(last, record)
                entries, offset = self._entries(last, offset)
                yield Part(last, record, entries)
                if offset > self._window.size:
                    self._log.note(last, "a chunk is damaged (the file ends within it)")
                    offset = self._next_chunk(last + 1)
            elif record.kind == MESSAGE:
                yield Part(last, record, [])
            else:
                self._keep(last, record)

    def faults(self) -> Iterator[str]:
        """Describe how the index of the file differs from what was found."""
        if self._header is None:
            yield "the bag header is missing"
            return
        stated = _number(self._header, b"index_pos")
        begin = self._window.size if self._index_start is None else self._index_start
        if not stated:
            yield "it has no index: its recorder was killed"
            return
        if stated != begin:
            yield f"the bag header points to byte {stated} as the index, which begins at {begin}"
        for name, what, found in (
            (b"conn_count", "connections", len(self.connections)),
            (b"chunk_count", "chunks", len(self._chunks)),
        ):
            if (count := _number(self._header, name)) != found:
                yield f"{count} {what} were written, {found} are there"
        if self.counts.keys() != self._chunks:
            n_right = len(self.counts.keys() & self._chunks)
            yield f"the index has {n_right} of {len(self._chunks)} chunks where they begin"
        if not self._indexed <= self.connections.keys():
            yield "the index does not have all connections"

    def _beginning(self) -> int:
        """Return where the records begin, and the end of the file if they cannot be read."""
        size = self._window.size
        found = _MAGIC.match(self._window.peek(0, _LONGEST_MAGIC))
        if not size:
            self._log.note(None, "the file seems to be empty", "record it again")
        elif not found:
            self._log.note(None, "File magic is invalid", _REINDEX)
            return self._next_chunk(0)
        elif (version := 100 * int(found[1]) + int(found[2])) != _VERSION:
            self._log.note(None, f"Bag version {version} is not supported", _REINDEX)
            return size
        elif found.end() == size:
            self._log.note(None, "it holds no record", _REINDEX)
        return found.end() if found else size

    def _record(self, offset: int) -> Record:
        """Read the record there; raises BagError if none begins or one but a chunk is cut off."""
        head = self._window.peek(offset, LONGEST_CHUNK_HEAD)
        size = header_size(head)
        if size > len(head):
            head = self._window.peek(offset, size)
        found = record_at(head, 0, len(head))
        record = Record(found.fields, offset + found.start, offset + found.end)
        is_whole = record.end <= self._window.size and record.end - record.start <= LARGEST_CONTENT
        if record.kind not in KINDS or not (is_whole or record.kind in (CHUNK, MESSAGE)):
            raise BagError("a record is cut off")
        return record

    def _sized(self, place: int, chunk: Record) -> tuple[Record, int]:
        """Return the chunk with all its data, and where it ends, also if its length is wrong.

        If no record begins behind it, packed data may be longer, since it has an end of its own.
        """
        if self._begins_record(chunk.end):
            return chunk, chunk.end
        if chunk.fields.get(b"compression") != b"none":
            longest = chunk.start + LARGEST_CONTENT
            return chunk._replace(end=min(longest, self._window.size)), chunk.end
        other = chunk._replace(end=chunk.start + _number(chunk, b"size"))
        if self._begins_record(other.end):
            self._log.note(place, "a chunk is damaged (its length is wrong)")
            return other, other.end
        return chunk, chunk.end

    def _begins_record(self, offset: int) -> bool:
        return offset == self._window.size or self._record_or_none(offset) is not None

    def _entries(self, place: int, offset: int) -> tuple[list[Entry], int]:
        """Read the index behind the chunk at `place`; returns its entries and where it ends."""
        found: list[Entry] = []
        while (record := self._record_or_none(offset)) and record.kind == INDEX:
            offset = record.end
            data = self._window.peek(record.start, record.end - record.start)
            entries = entries_of(record, data)
            if entries is None:
                self._log.note(place, "a chunk is damaged (its index has not the size it states)")
            else:
                found += entries
        self._indexed.update(connection for connection, _, _ in found)
        return found, offset

    def _record_or_none(self, offset: int) -> Record | None:
        try:
            return self._record(offset)
        except BagError:
            return None

    def _keep(self, place: int, record: Record) -> None:
        """Keep a record that is neither chunk nor message."""
        if record.kind == BAG_HEADER:
            self._header = record
            if encryptor := record.fields.get(b"encryptor"):
                self._log.note(
                    None, f"Bag encryption {encryptor.decode(errors='replace')!r} is not supported"
                )
        if record.kind not in (CONNECTION, CHUNK_INFO):
            return
        if self._index_start is None:
            self._index_start = place
        data = self._window.peek(record.start, record.end - record.start)
        try:
            if record.kind == CONNECTION:
                number, connection = connection_of(record, data)
                self.connections[number] = connection
            else:
                chunk, counts = counts_of(record, data)
                self.counts[chunk] = counts
                self._indexed.update(counts)
                if len(counts) != record.number(b"count"):
                    self._log.note(place, "the index has not the counts of a chunk that it states")
        except BagError as error:
            self._log.note(place, str(error))

    def _next_chunk(self, start: int) -> int:
        """Return where the next chunk begins, or the index, or else the end of the file."""
        place = start
        while (found := self._window.search(CHUNK_PATTERN, place, 8)) is not None:
            for begin in range(max(start, found - LONGEST_CHUNK_HEAD), found):
                if self._begins_chunk(begin):
                    return begin
            place = found + 1
        index = 0 if self._header is None else _number(self._header, b"index_pos")
        return index if index > start and self._is_index(index) else self._window.size

    def _is_index(self, offset: int) -> bool:
        """Whether the index of the file stands there."""
        while offset < self._window.size:
            record = self._record_or_none(offset)
            if record is None or record.kind not in (CONNECTION, CHUNK_INFO):
                return False
            offset = record.end
        return offset == self._window.size

    def _begins_chunk(self, offset: int) -> bool:
        record = self._record_or_none(offset)
        return bool(
            record and record.kind == CHUNK and {b"compression", b"size"} <= record.fields.keys()
        )


def _number(record: Record, name: bytes) -> int:
    """Return the number in a field, and 0 if there is none."""
    return int.from_bytes(record.fields.get(name, b""), "little")
