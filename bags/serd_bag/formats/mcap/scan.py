"""All messages of one MCAP file, sound or damaged, in the order they were written.

Reads record by record, unpacking messages itself, for which the reader of `mcap` takes more than
twice as long. Each kind of fault becomes a Damage.
"""

from collections import defaultdict
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

from mcap.opcode import Opcode

from serd_bag.damage import FileScan
from serd_bag.errors import BagError, disk_errors
from serd_bag.formats.limits import WRONG_TIMES
from serd_bag.formats.mcap.data_section import IN_AREAS, Area, DataSection
from serd_bag.formats.mcap.definitions import DEFINITIONS, Definitions
from serd_bag.formats.mcap.file_end import FileEnd
from serd_bag.formats.mcap.records import MESSAGE_HEAD, RECORD_HEAD, copied_index
from serd_bag.formats.mcap.window import FileWindow
from serd_bag.topic import RawMessage, Topic

_MESSAGE = int(Opcode.MESSAGE)
_COPIED = "attachments and metadata records"
_DIFFERS = "{} {} were written, {} are there"


class McapScan(FileScan):
    """One pass through one MCAP file.

    thorough: compare the index behind each chunk, and that of the summary, with the chunk.
    size: of the file as it was recorded, which limits what is read; None for its size here.
    """

    def __init__(self, path: Path, *, thorough: bool = False, size: int | None = None) -> None:
        super().__init__(path)
        self.has_checksums = True
        self._end = FileEnd(path)
        # Those of the data count, where the summary is not known to be right.
        known = self._end.definitions
        self._definitions = known if self._end.states_contents else Definitions(known)
        if self._end.statistics is not None:
            self.expected = self._end.statistics.message_count
        self._counts: defaultdict[int, int] = defaultdict(int)
        self._thorough = thorough
        self._looked_in: Area | None = None
        self._recorded_size = size
        self._looks_back = True

    def topics(self) -> list[Topic]:
        """Topics by the summary; where it is brief or missing, by the whole file."""
        if not self._end.states_contents:
            for _ in self.messages(frozenset()):
                pass
        return self._definitions.topics()

    def messages(self, topics: frozenset[str] | None = None) -> Iterator[RawMessage]:
        """Messages of the given topics, None for all."""
        path = self.path
        with disk_errors("read", path, BagError), path.open("rb", buffering=0) as stream:
            window = FileWindow(stream)
            size = window.size if self._recorded_size is None else self._recorded_size
            section = DataSection(window, self._end, self._log, size, thorough=self._thorough)
            for area in section.areas():
                yield from self._messages(section, area, topics)
                del area  # before the next one is read
            self.copied, self.has_checksums = section.copied, section.has_checksums
            for number, count in self._counts.items():
                self.counts[self._definitions.channels[number].topic] += count
            self._compare_with_end(section)
            self._definitions.complete(self._end.definitions)
            if self._thorough:
                self._compare_with_index(section, window)

    def _messages(
        self, section: DataSection, area: Area, topics: frozenset[str] | None
    ) -> Iterator[RawMessage]:
        """Messages in an area, whose definitions are collected."""
        unpack_message, message_size = MESSAGE_HEAD.unpack_from, MESSAGE_HEAD.size
        counts, names = self._counts, dict[int, tuple[str, str] | None]()
        block, offset, end, is_chunk, is_torn = area
        positions = section.positions
        left, last, n_unknown, n_other, n_untimed = section.n_records, offset, 0, 0, 0
        for left in range(section.n_records - 1, -1, -1):  # noqa: B007 (what is left after it)
            if offset + message_size > end or block[offset] != _MESSAGE:
                following = self._skip(section, area, offset)
                if following is None:
                    break
                last, offset = offset, following
                continue
            _, length, number, _, log_time, publish_time = unpack_message(block, offset)
            start, following = offset + message_size, offset + RECORD_HEAD.size + length
            if not start <= following <= end:
                if following > end:
                    break
                section.note("a message is shorter than its fields")
                self.n_left_out += 1
                last, offset = offset, following
                continue
            last, offset = offset, following
            if positions is not None:
                positions.extend((number, log_time, last - area.start))
            if (log_time | publish_time) >> 63:
                n_untimed += 1
                continue
            if number not in names:
                if not self._is_defined(section, area, number):
                    n_unknown += 1
                    continue
                if not self._definitions.is_of_its_topic(number):
                    n_other += 1
                    continue
                topic, type_name = self._definitions.names(number)
                wanted = topics is None or topic in topics
                names[number] = (topic, type_name) if wanted else None
            counts[number] += 1
            name = names[number]
            if name is not None:
                yield RawMessage(*name, block[start:offset], log_time, publish_time)
        section.n_records, section.consumed, section.last = left, offset, last
        if is_chunk and offset < end:
            if left and not is_torn:
                section.note("a record is longer than its chunk")
            elif not left:
                section.stop()
        self.n_left_out += n_unknown + n_other + n_untimed
        if n_unknown:
            section.note(f"{n_unknown} messages are of topics declared in a part that is lost")
        if n_other:
            section.note(f"{n_other} messages are of another type than the first of their topic")
        if n_untimed:
            section.note(f"{n_untimed} {WRONG_TIMES}")

    def _skip(self, section: DataSection, area: Area, offset: int) -> int | None:
        """The end of a record that is no message; None where it is not in the area."""
        if offset + RECORD_HEAD.size > area.end:
            return None
        opcode, length = RECORD_HEAD.unpack_from(area.block, offset)
        start = offset + RECORD_HEAD.size
        following = int(start + length)
        if following > area.end or not opcode or not (area.is_chunk or opcode in IN_AREAS):
            return None
        if opcode == _MESSAGE and following < offset + MESSAGE_HEAD.size:
            section.note("a message is shorter than its fields")
        elif opcode in DEFINITIONS:
            fault = self._definitions.add(opcode, area.block[start:following])
            if fault:
                section.note(fault)
        return following

    def _is_defined(self, section: DataSection, area: Area, number: int) -> bool:
        """Whether a channel is known, if need be from the rest of its chunk or of the file."""
        channels = self._definitions.channels
        if number not in channels and area.is_chunk and area is not self._looked_in:
            self._looked_in = area
            offset: int | None = area.start
            while offset is not None:
                offset = self._skip(section, area, offset)
        if number not in channels and number in self._end.definitions.channels:
            self._definitions.complete(self._end.definitions)
        if number not in channels and self._looks_back:
            self._looks_back = False
            other = McapScan(self.path, size=self._recorded_size)
            other._looks_back = False
            for _ in other.messages(frozenset()):
                pass
            self._definitions.complete(other._definitions)
        return number in channels

    def _compare_with_end(self, section: DataSection) -> None:
        end, note = self._end, section.note
        if not section.ended and not self._log:
            complete = "the data has no end record"
            note(
                complete if end.complete else "the file has no end: the recording was cut off here"
            )
        if section.ended and not end.complete:
            note("the summary at the end of the file is damaged")
        for each in end.faults.damage:
            note(each.what)
        for fault in self._definitions.faults_of(end.definitions):
            note(f"in the summary, {fault}")
        n_missing = len(set(end.index.starts) - section.visited)
        if n_missing:
            note(f"{n_missing} chunks of the summary are missing")
        if end.statistics is None:
            return
        stated, n_found = end.statistics, self.counts.total()
        if stated.message_count != n_found:
            note(f"{stated.message_count} messages were written, {n_found} are readable")
        elif stated.channel_message_counts and not self._log:
            for number, channel in self._definitions.channels.items():
                n_written = stated.channel_message_counts.get(number, 0)
                if n_written != (n_read := self._counts[number]):
                    note(
                        f"{n_written} messages were written on {channel.topic}, {n_read} are there"
                    )
        n_copied = stated.attachment_count + stated.metadata_count
        if n_copied > len(self.copied):
            note(_DIFFERS.format(n_copied, _COPIED, len(self.copied)))

    def _compare_with_index(self, section: DataSection, window: FileWindow) -> None:
        """Compare the summary's pointers and counts, which players use, with what was found."""
        end, note = self._end, section.note
        for fault in (*end.index_faults, *end.definitions.missing(self._definitions)):
            note(fault)
        if any(one == other for one, other in pairwise(end.index.starts)):
            note("the summary lists a chunk twice")
        copied = [copied_index(window, *each) for each in self.copied]
        for fault in end.index.faults_of_copied(copied):
            note(fault)
        stated, found = end.statistics, self._definitions
        if stated is None or self._log:
            return
        n_copied = stated.attachment_count + stated.metadata_count
        for what, n_stated, n_found in (
            ("chunks", stated.chunk_count, len(section.visited)),
            (_COPIED, n_copied, len(self.copied)),
            ("schemas", stated.schema_count, len(found.schemas)),
            ("channels", stated.channel_count, len(found.channels)),
        ):
            if n_stated != n_found:
                note(_DIFFERS.format(n_stated, what, n_found))
