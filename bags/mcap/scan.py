"""All messages of one MCAP file, sound or damaged, in the order they were written.

Reads record by record, unpacking messages itself, for which the reader of `mcap` takes more than
twice as long: a chunk whose checksum does not match is left out; where the chain of
records is broken, reading continues at the next chunk in the summary; the number of messages is
compared with that in the summary. Each fault becomes a Damage.
"""

import os
from bisect import bisect_right
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from mcap.stream_reader import MAGIC_SIZE
from mcap.summary import Summary
from mcap.writer import MCAP0_MAGIC

from bags.damage import Damage
from bags.errors import BagError
from bags.mcap.records import (
    MESSAGE_HEAD,
    RECORD_HEAD,
    chunk_records,
    index_matches,
    read_record,
    read_summary,
    torn_chunk_records,
)
from bags.rosbag2.message_types import MessageType
from bags.rosbag2.qos import qos_of_text
from bags.topic import RawMessage, Topic
from storage.errors import disk_error

_FIRST_PRIVATE_OPCODE = 0x80
_MESSAGE = int(Opcode.MESSAGE)
_DEFINITIONS = (int(Opcode.SCHEMA), int(Opcode.CHANNEL))


class McapScan:
    """One pass through one file; `damage` and `counts` are complete after `messages`.

    expected: number of messages by the summary, None without one.
    thorough: compare the index behind each chunk with the chunk.
    """

    def __init__(self, path: Path, *, thorough: bool = False) -> None:
        self.path = path
        self.damage: list[Damage] = []
        self._summary = read_summary(path)
        summary = self._summary or Summary()
        self.expected = summary.statistics.message_count if summary.statistics else None
        self._schemas, self._channels = summary.schemas, summary.channels
        self._chunk_starts = sorted(each.chunk_start_offset for each in summary.chunk_indexes)
        self._counts: defaultdict[int, int] = defaultdict(int)
        self._thorough = thorough
        self._last_chunk = b""
        self._indexes: list[bytes] = []
        self._offset = 0
        self._ended = False
        self._chunked = bool(self._chunk_starts)

    @property
    def counts(self) -> Counter[str]:
        """Readable messages by topic."""
        found: Counter[str] = Counter()
        for number, count in self._counts.items():
            found[self._channels[number].topic] += count
        return found

    def topics(self) -> list[Topic]:
        """Topics by the summary; where it is brief or missing, by the whole file."""
        if not self._summary_has_topics():
            for _ in self.messages(frozenset()):
                pass
        return [_topic(each, self._schemas.get(each.schema_id)) for each in self._channels.values()]

    def messages(self, topics: frozenset[str] | None = None) -> Iterator[RawMessage]:
        """Messages of the given topics, None for all."""
        try:
            with self.path.open("rb") as stream:
                size = os.fstat(stream.fileno()).st_size
                if self._begins_well(stream, size):
                    for records in self._parts(stream, size):
                        yield from self._messages(records, topics)
        except OSError as error:
            raise BagError(str(disk_error("read", self.path, error))) from None
        self._compare_with_summary()

    def _messages(self, records: bytes, topics: frozenset[str] | None) -> Iterator[RawMessage]:
        """Messages in the records of a chunk, whose definitions are collected."""
        unpack_message, message_size = MESSAGE_HEAD.unpack_from, MESSAGE_HEAD.size
        counts, names = self._counts, dict[int, tuple[str, str] | None]()
        n_unknown = offset = 0
        end = len(records)
        while offset + RECORD_HEAD.size <= end:
            if records[offset] != _MESSAGE or offset + message_size > end:
                offset = self._skip(records, offset)
                continue
            _, length, number, _, log_time, publish_time = unpack_message(records, offset)
            start = offset + message_size
            offset += RECORD_HEAD.size + length
            if not start <= offset <= end:
                break
            if number not in names:
                if number not in self._channels:
                    n_unknown += 1
                    continue
                names[number] = self._names(number, topics)
            counts[number] += 1
            wanted = names[number]
            if wanted is not None:
                yield RawMessage(*wanted, records[start:offset], log_time, publish_time)
        if n_unknown:
            self._note(f"{n_unknown} messages are of topics declared in a part that is lost")

    def _skip(self, records: bytes, offset: int) -> int:
        """The end of a record that is no message; a definition is kept."""
        opcode, length = RECORD_HEAD.unpack_from(records, offset)
        start = offset + RECORD_HEAD.size
        if opcode in _DEFINITIONS and start + length <= len(records):
            self._define(opcode, records[start : start + length])
        return start + int(length)

    def _names(self, number: int, topics: frozenset[str] | None) -> tuple[str, str] | None:
        """(topic, type name) of a channel, None where its messages are not wanted."""
        channel = self._channels[number]
        if topics is not None and channel.topic not in topics:
            return None
        return channel.topic, _type_name(self._schemas.get(channel.schema_id))

    def _parts(self, stream: BinaryIO, size: int) -> Iterator[bytes]:
        """The records of each chunk, or one message outside of chunks."""
        self._offset = MAGIC_SIZE
        while not self._ended:
            stream.seek(self._offset)
            head = stream.read(RECORD_HEAD.size)
            if len(head) < RECORD_HEAD.size:
                return
            opcode, length = RECORD_HEAD.unpack(head)
            rest = size - self._offset - RECORD_HEAD.size
            following = self._following_chunk()
            if not _plausible(opcode) or (length > rest and following is not None):
                self._note(f"no record begins with {head.hex(' ')}")
                if following is None:
                    return
                self._offset = following
                continue
            torn = length > rest
            if torn:
                self._note(f"the file ends within a record of {length} bytes")
            n_faults, content = len(self.damage), stream.read(min(length, rest))
            yield self._part(opcode, content, torn)
            if len(self.damage) > n_faults and following is not None:
                self._offset = following
            else:
                self._offset += RECORD_HEAD.size + len(content)

    def _part(self, opcode: int, content: bytes, torn: bool) -> bytes:
        """The records in one record of the file that may hold messages."""
        if opcode != Opcode.MESSAGE_INDEX:
            self._check_index()
        if opcode == Opcode.CHUNK:
            return self._chunk(content, torn)
        if opcode == Opcode.MESSAGE and self._chunked:
            self._note("a message is outside the chunks")
        elif opcode == Opcode.MESSAGE and not torn:
            return RECORD_HEAD.pack(opcode, len(content)) + content
        elif opcode in _DEFINITIONS and not torn:
            self._define(opcode, content)
        elif opcode == Opcode.MESSAGE_INDEX and not torn:
            if int.from_bytes(content[2:6], "little") != len(content) - 6:
                self._note("a message index is longer than its fields")
            self._indexes.append(content)
        elif opcode == Opcode.DATA_END:
            self._ended = True
        return b""

    def _chunk(self, content: bytes, torn: bool) -> bytes:
        self._chunked = True
        try:
            records = torn_chunk_records(content) if torn else chunk_records(content)
        except BagError as error:
            self._note(str(error))
            return b""
        if self._thorough:
            self._last_chunk = records
        return records

    def _begins_well(self, stream: BinaryIO, size: int) -> bool:
        magic, opcode = stream.read(MAGIC_SIZE), stream.read(1)
        if magic == MCAP0_MAGIC:
            return True
        if size == 0:
            self._note("the file is empty")
        else:
            self._note(
                f"an MCAP file begins with {MCAP0_MAGIC.hex(' ')}, this with {magic.hex(' ')}"
            )
        alike = magic[1:5] == MCAP0_MAGIC[1:5] or self._summary is not None
        return opcode == bytes([Opcode.HEADER]) and alike

    def _check_index(self) -> None:
        if self._thorough and not index_matches(self._last_chunk, self._indexes):
            self._note("the message index before this does not fit its chunk")
        self._last_chunk = b""
        self._indexes.clear()

    def _define(self, opcode: int, content: bytes) -> None:
        """Keep a schema or channel; one number never has two meanings."""
        try:
            if opcode == Opcode.SCHEMA:
                schema = read_record(Schema, content)
                same = self._schemas.setdefault(schema.id, schema) == schema
                number = schema.id
            else:
                channel = read_record(Channel, content)
                same = self._channels.setdefault(channel.id, channel) == channel
                number = channel.id
        except BagError as error:
            self._note(str(error))
            return
        if not same:
            kind = Opcode(opcode).name.lower()
            self._note(f"{kind} {number} is defined twice, in different ways")

    def _following_chunk(self) -> int | None:
        index = bisect_right(self._chunk_starts, self._offset)
        return self._chunk_starts[index] if index < len(self._chunk_starts) else None

    def _summary_has_topics(self) -> bool:
        """Whether the summary repeats the channels of the file; the format leaves that open."""
        if self._summary is None:
            return False
        statistics = self._summary.statistics
        counted = statistics.channel_message_counts.keys() if statistics else set()
        return bool(self._channels or self.expected == 0) and self._channels.keys() >= counted

    def _compare_with_summary(self) -> None:
        if not self._ended and not self.damage:
            self._note("the file has no end: the recording was cut off here")
        if self._ended and self._summary is None:
            self._note("the summary at the end of the file is damaged")
        found = sum(self._counts.values())
        if self.expected is not None and self.expected != found:
            self._note(f"{self.expected} messages were written, {found} are readable")
        elif self._summary is not None and self._summary.statistics and not self.damage:
            self._compare_topics(self._summary.statistics.channel_message_counts)

    def _compare_topics(self, counts: dict[int, int]) -> None:
        """Compare each topic with the statistics, where they count topics."""
        for number, channel in self._channels.items() if counts else ():
            written, found = counts.get(number, 0), self._counts[number]
            if written != found:
                self._note(f"{written} messages were written on {channel.topic}, {found} are there")

    def _note(self, what: str) -> None:
        self.damage.append(Damage(self.path, self._offset, what))


def _plausible(opcode: int) -> bool:
    """Whether it is an opcode of the data section, or one that a later version may add."""
    in_data = Opcode.HEADER <= opcode <= Opcode.DATA_END and opcode != Opcode.FOOTER
    return in_data or opcode >= _FIRST_PRIVATE_OPCODE


def _type_name(schema: Schema | None) -> str:
    return schema.name if schema else ""


def _topic(channel: Channel, schema: Schema | None) -> Topic:
    metadata = channel.metadata
    recorded = MessageType(
        name=_type_name(schema),
        text=schema.data.decode("utf-8", errors="replace") if schema else "",
        type_hash=metadata.get("topic_type_hash", ""),
        encoding=schema.encoding if schema else "",
    )
    qos = qos_of_text(metadata.get("offered_qos_profiles", ""))
    return Topic(channel.topic, recorded, qos, channel.message_encoding)
