"""All messages of one .bag file of ROS 1, as the ROS 2 messages of the same fields.

They are read in the order of the file, without the index: a killed recorder writes none, and one
that is wrong must hide nothing. It is compared with what was found. rosbags turns each message
into CDR by the definition that its connection holds. The format has no checksums. A chunk that
cannot be unpacked is left out, and so is a damaged message; where the records of a chunk are broken
off, reading continues at the next message of the index behind it.
"""

from collections import Counter
from collections.abc import Iterator
from functools import cached_property, lru_cache
from pathlib import Path
from typing import NamedTuple

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from serd_bag.damage import DamageLog, FileScan
from serd_bag.errors import BagError, disk_errors
from serd_bag.formats.limits import LARGEST_CONTENT
from serd_bag.formats.mcap.window import FileWindow
from serd_bag.formats.ros1.records import (
    CONNECTION,
    MESSAGE,
    Connection,
    Entry,
    Part,
    Walk,
    connection_of,
    record_at,
    unpacked_chunk,
)
from serd_bag.formats.rosbag2.message_types import MessageType
from serd_bag.formats.rosbag2.qos import RELIABLE
from serd_bag.topic import RawMessage, Topic

_HEADER = "std_msgs/msg/Header"
_LARGEST_CHUNK = 2 * LARGEST_CONTENT


class _Found(NamedTuple):
    """A message of a chunk: the entry that an index should have of it, and its data.

    before: offset of the connection records before it, to which an index may point, or its own.
    """

    entry: Entry
    before: int
    data: bytes


class Ros1Scan(FileScan):
    """One pass through one .bag file."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._connections: dict[int, Connection] = {}

    def topics(self) -> list[Topic]:
        """Topics of the file, by its index if that is right; of several types the first."""
        known = self._index.connections
        if not self._is_index_sound:
            for _ in self.messages(frozenset()):
                pass
            known = {**known, **self._connections}
        found: dict[str, Topic] = {}
        for connection in known.values():
            topic, _ = _converted(connection)
            found.setdefault(topic.name, topic)
        return list(found.values())

    def messages(self, topics: frozenset[str] | None = None) -> Iterator[RawMessage]:
        """Messages of the given topics, None for all; publish times are the log times."""
        n_broken = n_unknown = 0
        if self._index.counts:
            self.expected = sum(sum(counts.values()) for counts in self._index.counts.values())
        with disk_errors("read", self.path, BagError), self.path.open("rb", buffering=0) as stream:
            window = FileWindow(stream)
            walk = Walk(window, self._log)
            for part in walk.parts():
                for found in self._messages_of(part, window):
                    number, time_ns, _ = found.entry
                    listed = self._index.connections.get(number)
                    connection = self._connections.get(number) or listed
                    if connection is None:
                        n_unknown += 1
                        continue
                    topic, store = _converted(connection)
                    if topics is not None and topic.name not in topics:
                        self.counts[topic.name] += 1
                        continue
                    converted = _cdr(topic.type_name, store, found.data)
                    if converted is None:
                        n_broken += 1
                        continue
                    self.counts[topic.name] += 1
                    yield RawMessage(topic.name, topic.type_name, converted, time_ns, time_ns)
            for fault in walk.faults():
                self._note(fault)
            indexed = self._index.connections
            if indexed and self._connections.keys() - indexed.keys():
                self._note("the index does not have all connections of the chunks")
        self.n_left_out = n_broken + n_unknown
        if n_unknown:
            self._note(f"{n_unknown} messages are of connections declared in a part that is lost")
        if n_broken:
            self._note(f"{n_broken} messages do not fit the definition of their type")

    @cached_property
    def _index(self) -> Walk:
        """The walk through the file that has found all that stands outside of its chunks."""
        with disk_errors("read", self.path, BagError), self.path.open("rb", buffering=0) as stream:
            walk = Walk(FileWindow(stream), DamageLog(self.path))
            for _ in walk.parts():
                pass
        return walk

    @cached_property
    def _is_index_sound(self) -> bool:
        return not self._index.log and not any(self._index.faults())

    def _messages_of(self, part: Part, window: FileWindow) -> Iterator[_Found]:
        """Yield the messages of a chunk, or the one outside of chunks."""
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
            block, begin, end = unpacked_chunk(record, block, at, size, LARGEST_CONTENT)
        except BagError as error:
            self._log.note(place, f"a chunk is damaged ({error})")
            return
        places: set[Entry] = set()
        counts: Counter[int] = Counter()
        fault = ""
        if stated_size != end - begin and record.end <= window.size:
            fault = f"it must have {stated_size} bytes, got {end - begin}"
        for found in self._records(block, begin, end, sorted(entries, key=lambda each: each[2])):
            if isinstance(found, str):
                fault = fault or found
                continue
            counts[found.entry[0]] += 1
            places.update((found.entry, (*found.entry[:2], found.before)))
            yield found
        if (
            not fault
            and entries
            and not (len(entries) == counts.total() and places >= set(entries))
        ):
            fault = "the index behind it does not fit its messages"
        if not fault and self._index.counts.get(place, counts) != counts:
            fault = "the index counts other messages than it has"
        if fault:
            self._log.note(place, f"a chunk is damaged ({fault})")

    def _records(
        self, block: bytes, begin: int, end: int, entries: list[Entry]
    ) -> Iterator[_Found | str]:
        """Yield the messages in these bytes of a block, and a sentence wherever no record begins.

        entries: those of the index, in the order of their offsets from `begin`.
        """
        offset = last = begin
        before: int | None = None
        while offset < end:
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
                later = (each for each in entries if each[2] > last - begin)
                places = (
                    begin + each[2]
                    for each in later
                    if _begins_message(block, begin + each[2], end, each)
                )
                offset = next(places, end)
                last, before = offset, None
                continue
            if record.kind == CONNECTION:
                before = offset if before is None else before
            else:
                yield _Found(entry, entry[2] if before is None else before - begin, data)
                before = None
            last, offset = offset, record.end

    def _add(self, number: int, connection: Connection) -> None:
        """Keep a connection; of two with one number the one that the index has."""
        listed = self._index.connections.get(number, connection)
        twice = f"connection {number} is defined twice, in different ways"
        if listed != connection and self._is_index_sound:
            self._note(twice)
            _, store = _converted(listed)
            named = connection._replace(topic=listed.topic)  # as `topics` names it
            connection = listed if store else named
        kept = self._connections.setdefault(number, connection)
        if kept != connection:
            self._note(twice)
            if listed == connection:
                self._connections[number] = connection


def _begins_message(block: bytes, offset: int, end: int, entry: Entry) -> bool:
    """Whether the message of an entry, or its connection, begins there."""
    try:
        record = record_at(block, offset, end)
        if record.kind == CONNECTION:
            return record.number(b"conn") == entry[0]
        return record.kind == MESSAGE and entry[:2] == (record.number(b"conn"), record.time_ns())
    except BagError:
        return False


@lru_cache(maxsize=256)
def _converted(connection: Connection) -> tuple[Topic, Typestore | None]:
    """The topic with the definition of ROS 2, whose Header has no `seq`, and the store that
    converts its messages, None where the definition cannot be read."""
    topic, name, text = connection
    try:
        types = get_types_from_msg(text, name)
        if _HEADER in types:
            constants, fields = types[_HEADER]
            types[_HEADER] = constants, [each for each in fields if each[0] != "seq"]
        store = get_typestore(Stores.EMPTY)
        store.register(types)
        definition, _ = store.generate_msgdef(name, ros_version=2)
        recorded = MessageType(name, definition, store.hash_rihs01(name))
    except Exception:  # a recorded text may be anything
        return Topic(topic, MessageType(name, "", "", ""), (RELIABLE,)), None
    return Topic(topic, recorded, (RELIABLE,)), store


def _cdr(type_name: str, store: Typestore | None, data: bytes) -> bytes | None:
    if store is None or len(data) > LARGEST_CONTENT:
        return None
    try:
        return bytes(store.ros1_to_cdr(data, type_name))
    except Exception:  # generated code raises errors of any kind for foreign bytes
        return None
