"""Records of .bag files of ROS 1: a header of named fields and data, each after its length.

Format 2.0: a bag header, chunks that hold connections and messages, behind each chunk the index of
its messages by connection, and at the end connections and an entry for each chunk. Bytes of a file
may be anything; what is no record is a BagError. A walk goes through the records outside of
chunks, which no index leads; where no record begins, it continues at the next bytes that begin like
a chunk.
"""

import bz2
import re
import struct
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import chain
from typing import Any, NamedTuple

from serd_bag.damage import DamageLog, State
from serd_bag.errors import BagError
from serd_bag.formats.limits import LARGEST_CONTENT, LARGEST_DEFINITION
from serd_bag.formats.mcap.chunks import parts_unpacked
from serd_bag.formats.mcap.window import FileWindow
from serd_bag.topic import ROS1, ROS1MSG, Channel

MESSAGE, BAG_HEADER, INDEX, CHUNK, CHUNK_INFO, CONNECTION = 2, 3, 4, 5, 6, 7
KINDS = range(MESSAGE, CONNECTION + 1)
#: Bytes in the header of a chunk.
CHUNK_PATTERN = re.compile(rb"\x04\0{3}op=\x05")
LONGEST_CHUNK_HEAD = 128
_MESSAGE_PATTERN = re.compile(rb"\x04\0{3}op=[\x02\x07]")
_LONGEST_MESSAGE_HEAD = 300
#: A message whose header has the three usual fields, which are read in a fifth of the time.
USUAL_MESSAGE = re.compile(
    rb"\x26\0{3}(?:\x04\0{3}op=\x02|\x09\0{3}conn=(.{4})|\x0d\0{3}time=(.{4})(.{4})){3}(.{4})",
    re.DOTALL,
)
_MAGIC = re.compile(rb"#ROSBAG V(\d+)\.(\d+)\n")
_VERSION = 200
_LONGEST_MAGIC = 32
_REINDEX = "'rosbag reindex' of ROS 1 may repair it"
_SIZE = struct.Struct("<I")
_TIME = struct.Struct("<II")
_SECOND_NS = 1_000_000_000
_CHUNK_FIELDS = {b"compression", b"size"}
_OF_MESSAGES = (b"op", b"conn", b"time")
#: Values of a connection that are parts of a channel.
_NAMED = ("topic", "type", "message_definition")
#: Bytes of a compressed chunk that are unpacked at once.
_PIECE = 4096
#: Of an index: time in s and ns, offset in the chunk. Of a chunk: connection, number of messages.
_ENTRY, _COUNT = struct.Struct("<III"), struct.Struct("<II")
#: connection, time in ns, offset in the chunk
Entry = tuple[int, int, int]
#: A chunk with the entries of the index behind it, or a message outside of chunks, as the place
#: where the record begins, the record and the entries.
Part = tuple[int, "Record", list[Entry]]


class Record(NamedTuple):
    """One record: the fields of its header, and where its data starts and ends; has_right_lengths:
    whether its fields fill the header."""

    fields: dict[bytes, bytes]
    start: int
    end: int
    has_right_lengths: bool = True

    @property
    def kind(self) -> int:
        """The opcode."""
        return self.number(b"op")

    def number(self, name: bytes) -> int:
        """Return the whole number in a field; raises BagError if there is none."""
        value = self.fields.get(name, b"")
        if not 0 < len(value) <= _TIME.size:
            raise BagError(f"a record lacks the number {name.decode()}")
        return int.from_bytes(value, "little")

    def time_ns(self) -> int:
        """Return the time in the header; raises BagError if there is none."""
        number = self.number(b"time")
        return (number & 0xFFFFFFFF) * _SECOND_NS + (number >> 32)


def record_at(block: bytes, at: int, end: int) -> Record:
    """Read the record at that place of a block; its data may end beyond the block.

    Raises BagError if no record with a whole header begins there.
    """
    try:
        (size,) = _SIZE.unpack_from(block, at)
        start = at + _SIZE.size + size
        if start + _SIZE.size > end:
            raise BagError("a record is cut off")
        fields, end_of_fields = _fields(block, at + _SIZE.size, start)
        (data_size,) = _SIZE.unpack_from(block, start)
    except struct.error:
        raise BagError("a record is cut off") from None
    data_start = start + _SIZE.size
    found = Record(fields, data_start, data_start + data_size, end_of_fields == start)
    if len(found.fields.get(b"op", b"")) != 1:
        raise BagError("a record has no opcode")
    return found


def _fields(block: bytes, at: int, end: int) -> tuple[dict[bytes, bytes], int]:
    """The fields between two places, and where they end."""
    found = {}
    while at < end:
        (size,) = _SIZE.unpack_from(block, at)
        at += _SIZE.size
        name, separator, value = block[at : min(at + size, end)].partition(b"=")
        at += size
        # The last field ends with the header, whatever its own length says.
        if (at > end and name not in _OF_MESSAGES) or not separator:
            raise BagError("the header of a record is damaged")
        found[name] = value
    return found, at


def connection_of(record: Record, data: bytes) -> tuple[int, Channel]:
    """Read a connection record; returns its number and the channel, or raises BagError.

    Type, encoding and metadata are those that MCAP files have of ROS 1.
    """
    try:
        fields = {
            name.decode(errors="replace"): value.decode(errors="replace")
            for name, value in _fields(data, 0, len(data))[0].items()
        }
        topic = "/" + "/".join(filter(None, record.fields[b"topic"].decode().split("/")))
        kind, text = fields["type"], fields["message_definition"].encode()
    except (KeyError, ValueError, IndexError, struct.error):
        raise BagError("a connection record is damaged") from None
    further = tuple((name, fields[name]) for name in fields if name not in _NAMED)
    return record.number(b"conn"), Channel(topic, kind, ROS1, ROS1MSG, text, further)


def counts_of(record: Record, data: bytes) -> tuple[int, dict[int, int]]:
    """Read the entry of a chunk; returns the place of the chunk and its messages by connection."""
    whole = data[: len(data) // _COUNT.size * _COUNT.size]
    return record.number(b"chunk_pos"), dict(_COUNT.iter_unpack(whole))


def entries_of(record: Record, data: bytes) -> list[Entry] | None:
    """Read an index record; returns None if it has another number of entries than it states."""
    try:
        connection, count = record.number(b"conn"), record.number(b"count")
    except BagError:
        return None
    if len(data) != count * _ENTRY.size:
        return None
    rows = _ENTRY.iter_unpack(data)
    return [(connection, _SECOND_NS * second + ns, offset) for second, ns, offset in rows]


def unpacked_chunk(
    record: Record, block: bytes, at: int, size: int, most: int
) -> tuple[bytes, int, int, str]:
    """Unpack the data of a chunk at that place of a block, up to `most` bytes.

    Returns bytes, where in them the records begin and end, and why that is not all of them;
    without compression the bytes are the block. Raises BagError where nothing can be unpacked.
    """
    compression = record.fields.get(b"compression", b"").decode(errors="replace")
    if compression == "none":
        return block, at, min(at + size, len(block)), ""
    decompressor: Any
    if compression == "bz2":
        decompressor = bz2.BZ2Decompressor()
    elif compression == "lz4":
        from lz4.frame import LZ4FrameDecompressor

        decompressor = LZ4FrameDecompressor()
    else:
        raise BagError(f"its compression must be none, bz2 or lz4, got {compression!r}")
    unpacked, fault, end = bytearray(), "", min(at + size, len(block))
    try:
        pieces = (block[place : place + _PIECE] for place in range(at, end, _PIECE))
        for part in parts_unpacked(decompressor, pieces):
            unpacked += part[: most - len(unpacked)]
            if len(unpacked) >= most:
                break
    except (OSError, ValueError, RuntimeError, EOFError) as error:
        fault = str(error).strip().rstrip(".") or type(error).__name__
        if not unpacked:
            raise BagError(fault) from None
    if not (decompressor.eof or fault) and len(unpacked) < most:
        fault = "its data ends early"
    return bytes(unpacked), 0, len(unpacked), fault


def begins_message(block: bytes, offset: int, end: int) -> bool:
    """Whether a whole message or connection begins there."""
    try:
        record = record_at(block, offset, end)
        return (
            record.end <= end
            and record.kind in (MESSAGE, CONNECTION)
            and (record.kind == CONNECTION or bool(record.fields.get(b"time")))
        )
    except BagError:
        return False


def next_message(block: bytes, offset: int, end: int) -> int:
    """Return where the next message or connection begins, or the end."""
    while (found := _MESSAGE_PATTERN.search(block, offset, end)) is not None:
        for begin in range(max(offset, found.start() - _LONGEST_MESSAGE_HEAD), found.start()):
            if begins_message(block, begin, end):
                return begin
        offset = found.end()
    return end


class Walk:
    """What a walk has found, once it has ended.

    log: faults on the way; connections: outside of chunks; counts: messages by connection that the
    index has of each chunk, by its place; listed: those that the index behind each chunk has;
    span_ns: first and last time of these. mark: takes begin, end, state and reason of bytes that
    were not read.
    """

    def __init__(
        self,
        window: FileWindow,
        log: DamageLog,
        mark: Callable[[int, int, State, str], None] = lambda *_: None,
    ) -> None:
        self.connections: dict[int, Channel] = {}
        self._mark = mark
        self.counts: dict[int, dict[int, int]] = {}
        self.listed: dict[int, Counter[int]] = {}
        self.span_ns: list[int] = []
        self.log = log
        self._window = window
        self._header: Record | None = None
        self._index_start: int | None = None
        self._latest: tuple[int, Record] | None = None

    def parts(self) -> Iterator[Part]:
        """All chunks and messages in the order of the file."""
        offset = self._beginning()
        last = offset - 1
        while offset < self._window.size:
            try:
                record = self._record(offset)
            except BagError as error:
                self.log.note(offset, f"a chunk is damaged ({error})")
                begin, offset = offset, self._next_chunk(last + 1)
                self._mark(begin, offset, "lost", str(error))
                last = offset - 1
                continue
            last, offset = offset, record.end
            if record.kind == CHUNK:
                record, offset = self._sized(last, record)
                entries, offset = self._entries(last, offset)
                yield last, record, entries
                if offset > self._window.size:
                    self.log.note(last, "a chunk is damaged (the file ends within it)")
                    offset = self._next_chunk(last + 1)
            elif record.kind == MESSAGE:
                yield last, record, []
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
            (b"chunk_count", "chunks", len(self.listed)),
        ):
            if (count := _number(self._header, name)) != found:
                yield f"{count} {what} were written, {found} are there"
        if self.counts.keys() != self.listed.keys():
            n_right = len(self.counts.keys() & self.listed.keys())
            yield f"the index has {n_right} of {len(self.listed)} chunks where they begin"
        if not {*chain(*self.counts.values(), *self.listed.values())} <= self.connections.keys():
            yield "the index does not have all connections"

    def _beginning(self) -> int:
        """Return where the records begin, and the end of the file if they cannot be read."""
        size = self._window.size
        found = _MAGIC.match(self._window.read(0, _LONGEST_MAGIC))
        if not size:
            self.log.note(None, "the file seems to be empty", "record it again")
        elif not found:
            self.log.note(None, "File magic is invalid", _REINDEX)
            begin = self._next_chunk(0)
            self._mark(0, begin, "lost", "no record begins here")
            return begin
        elif (version := 100 * int(found[1]) + int(found[2])) != _VERSION:
            self.log.note(None, f"Bag version {version} is not supported", _REINDEX)
            return size
        elif found.end() == size:
            self.log.note(None, "it holds no record", _REINDEX)
        return found.end() if found else size

    def _record(self, offset: int) -> Record:
        """The record there, read once; BagError if none begins, or one but a chunk is cut off."""
        if self._latest is None or self._latest[0] != offset:
            self._latest = offset, self._read(offset)
        return self._latest[1]

    def _read(self, offset: int) -> Record:
        head = self._window.read(offset, LONGEST_CHUNK_HEAD)
        if len(head) < _SIZE.size:
            raise BagError("a record is cut off")
        (size,) = _SIZE.unpack_from(head)
        if size > LARGEST_DEFINITION:
            raise BagError(f"no record begins with {head[: _SIZE.size].hex(' ')}")
        if size + 2 * _SIZE.size > len(head):
            head = self._window.read(offset, size + 2 * _SIZE.size)
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
            self.log.note(place, "a chunk is damaged (its length is wrong)")
            return other, other.end
        return chunk, chunk.end

    def _begins_record(self, offset: int) -> bool:
        return offset == self._window.size or self._record_or_none(offset) is not None

    def _entries(self, place: int, offset: int) -> tuple[list[Entry], int]:
        """Read the index behind the chunk at `place`; returns its entries and where it ends."""
        found: list[Entry] = []
        while (record := self._record_or_none(offset)) and record.kind == INDEX:
            offset = record.end
            data = self._window.read(record.start, record.end - record.start)
            entries = entries_of(record, data)
            if entries is None:
                self.log.note(place, "a chunk is damaged (its index has not the size it states)")
            else:
                found += entries
        self.listed[place] = Counter(connection for connection, _, _ in found)
        times_ns = [*self.span_ns, *(time_ns for _, time_ns, _ in found)]
        self.span_ns = [min(times_ns), max(times_ns)] if times_ns else []
        return found, offset

    def _record_or_none(self, offset: int) -> Record | None:
        with suppress(BagError):
            return self._record(offset)
        return None

    def _keep(self, place: int, record: Record) -> None:
        if record.kind == BAG_HEADER:
            self._header = record
            if encryptor := record.fields.get(b"encryptor"):
                self.log.note(
                    None, f"Bag encryption {encryptor.decode(errors='replace')!r} is not supported"
                )
        if record.kind not in (CONNECTION, CHUNK_INFO):
            return
        if self._index_start is None:
            self._index_start = place
        data = self._window.read(record.start, record.end - record.start)
        try:
            if record.kind == CONNECTION:
                number, connection = connection_of(record, data)
                self.connections[number] = connection
            else:
                chunk, counts = counts_of(record, data)
                self.counts[chunk] = counts
                if len(counts) != record.number(b"count"):
                    self.log.note(place, "the index has not the counts of a chunk that it states")
        except BagError as error:
            self.log.note(place, str(error))

    def _next_chunk(self, start: int) -> int:
        """Return where the next chunk begins, or the index, or else the end of the file."""
        place = start
        while (found := self._window.search(CHUNK_PATTERN, place, 8)) is not None:
            for begin in range(max(start, found - LONGEST_CHUNK_HEAD), found):
                record = self._record_or_none(begin)
                if record and record.kind == CHUNK and record.fields.keys() >= _CHUNK_FIELDS:
                    return begin
            place = found + 1
        index = 0 if self._header is None else _number(self._header, b"index_pos")
        return index if index > start and self._is_index(index) else self._window.size

    def _is_index(self, offset: int) -> bool:
        while offset < self._window.size:
            record = self._record_or_none(offset)
            if record is None or record.kind not in (CONNECTION, CHUNK_INFO):
                return False
            offset = record.end
        return offset == self._window.size


def _number(record: Record, name: bytes) -> int:
    return int.from_bytes(record.fields.get(name, b""), "little")
