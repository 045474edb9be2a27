"""All messages of one .bag file of ROS 1, as the ROS 2 messages of the same fields.

rosbags reads the file and turns each message into CDR by the definition that its connection holds.
The format has no checksums, and without its index, which a killed recorder does not write, rosbags
reads nothing. Messages come in the order of their log times. A chunk whose head, index or content
is damaged is left out, and so is a damaged message; the others are read.
"""

import bz2
import heapq
import io
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import cast

import lz4.frame
from rosbags.interfaces import Connection
from rosbags.rosbag1.reader import Chunk, IndexData, Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from bags.damage import Damage, DamageLog
from bags.formats.limits import LARGEST_CONTENT
from bags.formats.rosbag2.message_types import MessageType
from bags.formats.rosbag2.qos import RELIABLE
from bags.topic import RawMessage, Topic

_HEADER = "std_msgs/msg/Header"


@dataclass(frozen=True)
class _Converted:
    """One connection: its topic, and the store that converts its messages, None where unknown."""

    topic: Topic
    store: Typestore | None


class _DamagedError(Exception):
    """A message or its chunk cannot be read."""


class _Entries:
    """Places of messages in the order of time; unreadable: chunks whose entries are left out."""

    def __init__(self, entries: Iterable[IndexData]) -> None:
        self._entries = iter(entries)
        self.newest = IndexData(0, -1, 0)
        self.unreadable: set[int] = set()
        self.ended = False

    def __iter__(self) -> Iterator[IndexData]:
        for each in self._entries:
            self.newest = each
            if each.chunk_pos not in self.unreadable:
                yield each
        self.ended = True


class _Reader(Reader):
    """Opens a file in which heads or indexes of chunks are damaged, by whose positions `damaged`
    holds why."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.damaged: dict[int, str] = {}

    def read_chunk(self) -> Chunk:
        """One without content where its head is damaged; its index is then not read either."""
        assert self.bio
        position = self.bio.tell()
        try:
            return super().read_chunk()
        except Exception as error:  # rosbags raises errors of any kind for foreign bytes
            self.damaged[position] = _reason(error)
            return Chunk(0, 0, bytes)

    def read_index_data(self, pos: int, indexes: dict[int, list[IndexData]]) -> None:
        """Nothing after the first damaged index of a chunk."""
        try:
            if pos not in self.damaged:
                super().read_index_data(pos, indexes)
        except Exception as error:
            self.damaged[pos] = _reason(error)

    def readable(self, wanted: list[Connection]) -> Iterator[tuple[Connection, int, bytes]]:
        """Messages of these connections; those that cannot be read are left out."""
        left = _Entries(heapq.merge(*(self.indexes[each.id] for each in wanted)))
        # `messages` takes them one by one, and goes on with the next where it is called again.
        self.indexes = {each.id: [] for each in wanted[1:]}
        self.indexes |= {each.id: cast("list[IndexData]", left) for each in wanted[:1]}
        while not left.ended:
            with suppress(_DamagedError):
                yield from self._until_damage(wanted, left)

    def _until_damage(
        self, wanted: list[Connection], left: "_Entries"
    ) -> Iterator[tuple[Connection, int, bytes]]:
        try:
            yield from self.messages(wanted)
        except GeneratorExit:
            raise
        except Exception as error:
            chunk = left.newest.chunk_pos
            self.damaged[chunk] = _reason(error)
            if self.current_chunk[0] != chunk:
                left.unreadable.add(chunk)
            self.current_chunk = (-1, io.BytesIO())
            raise _DamagedError from None


class Ros1Scan:
    """One pass through one file; `damage` and `counts` are complete after `messages`."""

    has_checksums = False

    def __init__(self, path: Path) -> None:
        self.path = path
        self._log = DamageLog(path)
        self.counts: Counter[str] = Counter()
        self.expected: int | None = None

    @property
    def damage(self) -> list[Damage]:
        """Each kind of fault that was found."""
        return self._log.damage

    def topics(self) -> list[Topic]:
        """Topics of the file; of several types on one topic the first."""
        found: dict[str, Topic] = {}
        for reader in self._opened():
            for connection in reader.connections:
                topic = _converted(connection).topic
                found.setdefault(topic.name, topic)
        return list(found.values())

    def messages(self, topics: frozenset[str] | None = None) -> Iterator[RawMessage]:
        """Messages of the given topics, None for all; publish times are the log times."""
        n_broken = 0
        for reader in self._opened():
            known = {each.id: _converted(each) for each in reader.connections}
            wanted = [
                each
                for each in reader.connections
                if topics is None or known[each.id].topic.name in topics
            ]
            self.expected = reader.message_count
            self._count_others(reader, known, wanted)
            for connection, time_ns, data in reader.readable(wanted):
                kind = known[connection.id]
                converted = _cdr(kind, data)
                if converted is None:
                    n_broken += 1
                    continue
                self.counts[kind.topic.name] += 1
                yield RawMessage(kind.topic.name, kind.topic.type_name, converted, time_ns, time_ns)
            for position, reason in sorted(reader.damaged.items()):
                self._log.note(position, f"a chunk is damaged ({reason})")
        if n_broken:
            self._note(f"{n_broken} messages do not fit the definition of their type")

    def _opened(self) -> Iterator[_Reader]:
        """The open file, or nothing where it cannot be opened."""
        reader = _Reader(self.path)
        try:
            reader.open()
        except Exception as error:  # rosbags raises errors of any kind for foreign bytes
            is_empty = not self.path.stat().st_size
            fix = "record it again" if is_empty else "'rosbag reindex' of ROS 1 may repair it"
            self._log.note(None, _reason(error), fix)
            return
        for position, chunk in reader.chunks.items():
            bounded = _bounded(chunk.decompressor)
            reader.chunks[position] = chunk._replace(decompressor=bounded)
        try:
            yield reader
        finally:
            reader.close()

    def _count_others(
        self, reader: _Reader, known: dict[int, _Converted], wanted: list[Connection]
    ) -> None:
        read = {each.id for each in wanted}
        for connection in reader.connections:
            if connection.id not in read:
                self.counts[known[connection.id].topic.name] += connection.msgcount

    def _note(self, what: str) -> None:
        self._log.note(None, what)


def _converted(connection: Connection) -> _Converted:
    """rosbags normalises names: std_msgs/String is std_msgs/msg/String."""
    topic = "/" + connection.topic.lstrip("/")
    return _converted_type(topic, connection.msgtype, connection.msgdef.data)


@lru_cache(maxsize=256)
def _converted_type(topic_name: str, name: str, text: str) -> _Converted:
    recorded = MessageType(name, "", "", "")
    try:
        store = _store(name, text)
        definition, _ = store.generate_msgdef(name, ros_version=2)
        recorded = MessageType(name, definition, store.hash_rihs01(name))
    except Exception:  # a recorded text may be anything
        return _Converted(Topic(topic_name, recorded, (RELIABLE,)), None)
    return _Converted(Topic(topic_name, recorded, (RELIABLE,)), store)


def _store(name: str, text: str) -> Typestore:
    """The types with the Header of ROS 2, which has no `seq`."""
    types = get_types_from_msg(text, name)
    if _HEADER in types:
        constants, fields = types[_HEADER]
        types[_HEADER] = constants, [each for each in fields if each[0] != "seq"]
    store = get_typestore(Stores.EMPTY)
    store.register(types)
    return store


def _cdr(kind: _Converted, data: bytes) -> bytes | None:
    if kind.store is None or len(data) > LARGEST_CONTENT:
        return None
    try:
        return bytes(kind.store.ros1_to_cdr(data, kind.topic.type_name))
    except Exception:  # generated code raises errors of any kind for foreign bytes
        return None


def _bounded(decompress: Callable[[bytes], bytes]) -> Callable[[bytes], bytes]:
    """The same for chunks of any size, of which no more than the limit is unpacked."""
    if decompress is bz2.decompress:
        return lambda data: bz2.BZ2Decompressor().decompress(data, LARGEST_CONTENT)
    if decompress is lz4.frame.decompress:
        return lambda data: lz4.frame.LZ4FrameDecompressor().decompress(data, LARGEST_CONTENT)
    return decompress


def _reason(error: Exception) -> str:
    return str(error).strip().rstrip(".") or type(error).__name__
