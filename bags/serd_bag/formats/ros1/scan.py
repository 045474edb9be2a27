"""All messages of one .bag file of ROS 1, as they are.

They are read in the order of the file, without the index: a killed recorder writes none, and one
that is wrong must hide nothing. It is compared with what was found. The format has no checksums. Of
a chunk that cannot be unpacked to its end the messages before are doubtful, and so is a message
behind which no other record begins; reading continues at the next bytes that look like one.
"""

import struct
from collections import Counter
from collections.abc import Generator, Iterator
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from serd_bag.damage import DamageLog, FileScan, State, Stated
from serd_bag.errors import BagError
from serd_bag.formats.limits import LARGEST_CONTENT, LARGEST_MESSAGE, MOST_PACKED
from serd_bag.formats.mcap.window import FileWindow
from serd_bag.formats.ros1.records import (
    CONNECTION,
    MESSAGE,
    USUAL_MESSAGE,
    Entry,
    Part,
    Walk,
    begins_message,
    connection_of,
    next_message,
    record_at,
    unpacked_chunk,
)
from serd_bag.formats.ros1.records import Record as RosRecord
from serd_bag.topic import Channel, Record

_LARGEST_CHUNK = LARGEST_MESSAGE
_SECOND_NS = 1_000_000_000
_NUMBERS = struct.Struct("<4I")
_MAKE = tuple.__new__


class _Found(NamedTuple):
    """A message of a chunk: the entry that an index should have of it, and its data.

    before: offset of the connection records before it, to which an index may point, or its own.
    """

    entry: Entry
    before: int
    data: bytes
    is_doubtful: bool = False


class Ros1Scan(FileScan):
    """One walk through one .bag file."""

    profile = "ros1"

    def __init__(self, path: Path, start: int = 0, end: int | None = None) -> None:
        super().__init__(path, start, end)
        self._connections: dict[int, Channel] = {}
        #: whether messages are outside of chunks, which nothing counts
        self._is_loose = False

    def stated(self) -> Stated | None:
        """Contents by the index, whose counts agree with the entries behind all chunks."""
        index = self._index
        if not self._is_index_sound or self._is_loose or index.counts != index.listed:
            return None
        counts: Counter[str] = Counter()
        for number, count in sum(index.listed.values(), Counter()).items():
            counts[index.connections[number].topic] += count
        types = {
            each.topic: each.type_name.replace("/", "/msg/")
            for each in reversed(index.connections.values())
        }
        return Stated(types, counts, *(index.span_ns or (0, 0)))

    def channels(self) -> list[Channel]:
        """Channels of the file, by its index if that is right."""
        known = self._index.connections
        if not self._is_index_sound:
            for _ in self.records(frozenset()):
                pass
            known = {**known, **self._connections}
        return list(known.values())

    def records(
        self, topics: frozenset[str] | None = None, *, doubtful: bool = False
    ) -> Iterator[Record]:
        """Messages of the given topics, None for all; publish times are the log times."""
        n_unknown = n_doubted = 0
        if self._index.counts:
            self.expected = sum(sum(counts.values()) for counts in self._index.counts.values())
        with self.opened() as window:
            walk = Walk(window, self.log, self.mark)
            known, listed = self._connections, self._index.connections
            for part in walk.parts():
                for found in self._messages_of(part, window):
                    number, time_ns, _ = found.entry
                    channel = known.get(number) or listed.get(number)
                    if channel is None:
                        n_unknown += 1
                    elif not found.is_doubtful:
                        self.counts[channel.topic] += 1
                    elif doubtful:
                        self.n_doubtful[channel.topic] += 1
                    else:
                        n_doubted += 1
                        continue
                    if channel is not None and (topics is None or channel.topic in topics):
                        self.is_doubtful = found.is_doubtful
                        # NamedTuple's own constructor takes twice as long.
                        yield _MAKE(Record, (channel, 0, found.data, time_ns, time_ns))
            self.is_doubtful = False
            self._take_counts()
            for fault in walk.faults():
                self.log.note(None, fault, is_harmless=True)
            indexed = self._index.connections
            if indexed and self._connections.keys() - indexed.keys():
                what = "the index does not have all connections of the chunks"
                self.log.note(None, what, is_harmless=True)
        self.n_left_out = n_unknown + n_doubted
        if n_unknown:
            self.log.note(
                None, f"{n_unknown} messages are of connections declared in a part that is lost"
            )

    def _take_counts(self) -> None:
        self.is_cut = not self._index.counts
        for counts in self._index.counts.values():
            for number, count in counts.items():
                if number in self._index.connections:
                    topic = self._index.connections[number].topic
                    self.expected_of[topic] = self.expected_of.get(topic, 0) + count

    @cached_property
    def _index(self) -> Walk:
        """The walk through the file that has found all that stands outside of its chunks."""
        with self.opened() as window:
            walk = Walk(window, DamageLog(self.path))
            for _, record, _ in walk.parts():
                self._is_loose |= record.kind == MESSAGE
        return walk

    @cached_property
    def _is_index_sound(self) -> bool:
        return not self._index.log and not any(self._index.faults())

    def _messages_of(self, part: Part, window: FileWindow) -> Iterator[_Found]:
        place, record, entries = part
        size = min(record.end, window.size) - record.start
        try:
            if size > _LARGEST_CHUNK:
                raise BagError(f"it must have {_LARGEST_CHUNK} bytes at most, got {size}")
            block, at = window.locate(record.start, size)
            if record.kind == MESSAGE:
                entry = record.number(b"conn"), record.time_ns(), place
                yield _Found(entry, place, block[at : at + size])
                return
            stated_size = record.number(b"size")
            most = max(LARGEST_CONTENT, MOST_PACKED * size)
            block, begin, end, fault = unpacked_chunk(record, block, at, size, most)
        except BagError as error:
            self._damaged_chunk(place, record, str(error), "lost")
            return
        places: set[Entry] = set()
        counts: Counter[int] = Counter()
        is_partial = bool(fault)
        if not fault and stated_size != end - begin and record.end <= window.size:
            fault = f"it must have {stated_size} bytes, got {end - begin}"
        for found in self._records(block, begin, end):
            if isinstance(found, str):
                fault = fault or found
                continue
            counts[found.entry[0]] += 1
            places.add(found.entry)
            if found.before != found.entry[2]:
                places.add((*found.entry[:2], found.before))
            yield found._replace(is_doubtful=True) if is_partial else found
        if (
            not fault
            and entries
            and not (len(entries) == counts.total() and places >= set(entries))
        ):
            fault = "the index behind it does not fit its messages"
        if not fault and self._index.counts.get(place, counts) != counts:
            fault = "the index counts other messages than it has"
        if fault:
            self._damaged_chunk(place, record, fault, "partly read")

    def _damaged_chunk(self, place: int, record: RosRecord, fault: str, state: State) -> None:
        self.log.note(place, f"a chunk is damaged ({fault})")
        self.mark(place, record.end, state, fault)

    def _records(self, block: bytes, begin: int, end: int) -> Iterator[_Found | str]:
        """Yield the messages in these bytes, and a sentence wherever no record begins."""
        offset, before = begin, None
        while offset < end:
            offset, before = yield from _usual_messages(block, offset, before, begin, end)
            if offset == end:
                return
            try:
                record = record_at(block, offset, end)
                if record.end > end or record.kind not in (MESSAGE, CONNECTION):
                    raise BagError("a record in it is cut off")
                data = block[record.start : record.end]
                if record.kind == CONNECTION:
                    self._add(*connection_of(record, data))
                else:
                    entry = record.number(b"conn"), record.time_ns(), offset - begin
            except BagError as error:
                yield str(error)
                offset, before = next_message(block, offset + 1, end), None
                continue
            if record.kind == CONNECTION:
                before = offset if before is None else before
                offset = record.end
                continue
            if not record.has_right_lengths:
                yield "a field of a record has a wrong length"
            place, before = entry[2] if before is None else before - begin, None
            if record.end < end and not begins_message(block, record.end, end):
                # It may be longer than it states, or shorter.
                offset = next_message(block, offset + 1, end)
                yield f"no record begins behind a message at byte {entry[2]} of it"
                if offset >= record.end:
                    yield _Found(entry, place, data, is_doubtful=True)
                continue
            yield _Found(entry, place, data)
            offset = record.end

    def _add(self, number: int, connection: Channel) -> None:
        """Keep a connection; of two with one number the one that the index has."""
        listed = self._index.connections.get(number, connection)
        twice = f"connection {number} is defined twice, in different ways"
        if listed != connection and self._is_index_sound:
            self.log.note(None, twice)
            from serd_bag.formats.ros1.conversion import can_convert

            named = replace(connection, topic=listed.topic)  # as `channels` names it
            connection = listed if can_convert(listed) else named
        kept = self._connections.setdefault(number, connection)
        if kept != connection:
            self.log.note(None, twice)
            if listed == connection:
                self._connections[number] = connection


def _usual_messages(
    block: bytes, offset: int, before: int | None, begin: int, end: int
) -> Generator[_Found, None, tuple[int, int | None]]:
    """Yield messages that are followed by messages of the usual form, or by the end; returns where
    the next record begins, and the connection records before it, if there are any."""
    usual = USUAL_MESSAGE.match(block, offset, end)
    while usual is not None and None not in (groups := usual.groups()):
        number, second, nanosecond, size = _NUMBERS.unpack(b"".join(groups))
        start, following = usual.end(), usual.end() + size
        usual = USUAL_MESSAGE.match(block, following, end)
        if usual is None and following != end:
            break
        entry = number, second * _SECOND_NS + nanosecond, offset - begin
        place = entry[2] if before is None else before - begin
        yield _MAKE(_Found, (entry, place, block[start:following], False))
        offset, before = following, None
    return offset, before
