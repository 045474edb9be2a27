"""All messages of one MCAP file, sound or damaged, in the order they were written.

Reads record by record, unpacking messages itself, for which the reader of `mcap` takes more than
twice as long. Each kind of fault becomes a Damage.
"""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import Metadata
from mcap.stream_reader import MAGIC_SIZE

from serd_bag.damage import FileScan, Stated
from serd_bag.formats.limits import LARGEST_DEFINITION
from serd_bag.formats.mcap.data_section import IN_AREAS, RUN_PATTERN, Area, DataSection
from serd_bag.formats.mcap.definitions import DEFINITIONS, Definitions
from serd_bag.formats.mcap.file_end import FileEnd
from serd_bag.formats.mcap.records import MESSAGE_HEAD, RECORD_HEAD, copied_index, read_record
from serd_bag.formats.mcap.window import FileWindow
from serd_bag.topic import Channel, Record

_MESSAGE = int(Opcode.MESSAGE)
_METADATA = bytes([Opcode.METADATA])
_MAKE = tuple.__new__
_LONGEST_PROFILE = 64
_COPIED = "attachments and metadata records"
_DIFFERS = "{} {} were written, {} are there"


class McapScan(FileScan):
    """One walk through one MCAP file.

    thorough: compare the index behind each chunk, and that of the summary, with the chunk.
    size: of the file as it was recorded, which limits what is read; None for its size here.
    """

    def __init__(
        self,
        path: Path,
        start: int = 0,
        end: int | None = None,
        *,
        thorough: bool = False,
        size: int | None = None,
    ) -> None:
        super().__init__(path, start, end)
        self.has_checksums = True
        with self.opened() as window:
            self._end = FileEnd(path, window)
            self.profile = profile_of(window)
        # Those of the data count, where the summary is not known to be right.
        known = self._end.definitions
        self._definitions = known if self._end.states_contents else Definitions(known)
        self._doubted = Definitions()
        if self._end.statistics is not None:
            self.expected = self._end.statistics.message_count
        self._counts: defaultdict[int, int] = defaultdict(int)
        self._thorough = thorough
        self._recorded_size = size
        self._looks_back, self._takes_doubted = True, False

    def stated(self) -> Stated | None:
        """Contents by the summary, whose statistics agree with the sizes of all indexes."""
        statistics, counts = self._end.statistics, Counter[str]()
        if statistics is None or not self._end.states_contents:
            return None
        channels = self._end.definitions.channels
        for number, count in statistics.channel_message_counts.items():
            counts[channels[number].topic] += count
        types = {each.topic: each.type_name for each in reversed(self._end.definitions.all())}
        return Stated(types, counts, statistics.message_start_time, statistics.message_end_time)

    def channels(self) -> list[Channel]:
        """Channels by the summary; where it is brief or missing, by the whole file."""
        if not self._end.states_contents:
            for _ in self.records(frozenset(), doubtful=True):
                pass
            self._definitions.complete(self._doubted)
        return self._definitions.all()

    def records(
        self, topics: frozenset[str] | None = None, *, doubtful: bool = False
    ) -> Iterator[Record]:
        """Messages of the given topics, None for all; doubtful ones too where that is asked for."""
        self._takes_doubted = doubtful
        with self.opened() as window:
            size = window.size if self._recorded_size is None else self._recorded_size
            section = DataSection(window, self._end, self, size, thorough=self._thorough)
            for area in section.areas():
                if area.doubted is None:
                    yield from self._messages(section, area, topics, doubtful=doubtful)
                elif doubtful:
                    yield from self._doubtful_messages(section, area, topics)
                del area  # before the next one is read
            self.copied, self.has_checksums = section.copied, section.has_checksums
            for number, count in self._counts.items():
                self.counts[self._definitions.channels[number].topic] += count
            self._compare_with_end(section)
            self._definitions.complete(self._end.definitions)
            if self._thorough:
                self._compare_with_index(section, window)

    def metadata(self) -> list[tuple[str, dict[str, str]]]:
        """Names and values of the sound metadata records that were found."""
        found = []
        with self.opened() as window:
            for offset, length in self.copied:
                if window.read(offset, 1) == _METADATA and length < LARGEST_DEFINITION:
                    record = read_record(Metadata, window.read(offset, length)[RECORD_HEAD.size :])
                    found.append((record.name, record.metadata))
        return found

    def _messages(
        self, section: DataSection, area: Area, topics: frozenset[str] | None, *, doubtful: bool
    ) -> Iterator[Record]:
        """Messages in an area, whose definitions are collected.

        Without a checksum a message is doubtful behind which no record can begin.
        """
        unpack_message, message_size = MESSAGE_HEAD.unpack_from, MESSAGE_HEAD.size
        counts, channels = self._counts, dict[int, Channel | None]()
        block, offset, end, is_chunk, is_torn, _ = area
        positions = section.positions
        left, last, n_unknown = section.n_records, offset, 0
        is_loose = is_torn or not is_chunk
        for left in range(section.n_records - 1, -1, -1):  # noqa: B007 (what is left after it)
            if offset + message_size > end or block[offset] != _MESSAGE:
                following = self._skip(section, area, offset)
                if following is None:
                    break
                last, offset = offset, following
                continue
            _, length, number, sequence, log_time, publish_time = unpack_message(block, offset)
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
            if number not in channels:
                if not self._is_defined(number):
                    n_unknown += 1
                    continue
                channel = self._definitions.channel(number)
                is_wanted = topics is None or channel.topic in topics
                channels[number] = channel if is_wanted else None
            wanted = channels[number]
            if is_loose and not _may_begin(block, offset, end):
                topic = self._definitions.channel(number).topic
                self.n_doubtful[topic] += 1
                wanted, self.is_doubtful = wanted if doubtful else None, True
            else:
                counts[number] += 1
            if wanted is not None:
                # NamedTuple's own constructor takes twice as long.
                data = block[start:offset]
                yield _MAKE(Record, (wanted, sequence, data, log_time, publish_time))
            self.is_doubtful = False
        section.n_records, section.consumed, section.last = left, offset, last
        if is_chunk and offset < end:
            if left and not is_torn:
                section.note("a record is longer than its chunk")
            elif not left:
                section.stop()
        self.n_left_out += n_unknown
        if n_unknown:
            section.note(f"{n_unknown} messages are of topics declared in a part that is lost")

    def _doubtful_messages(
        self, section: DataSection, area: Area, topics: frozenset[str] | None
    ) -> Iterator[Record]:
        """What looks like messages in an area whose checksum does not fit."""
        known, doubted, block = self._definitions, self._doubted, area.block
        known.complete(self._end.definitions)
        remains = _Remains(area, lambda each: each in known.channels or each in doubted.channels)
        for begin, end in remains.places():
            section.n_records -= 1
            if section.n_records <= 0:
                section.stop()
                return
            if block[begin] != _MESSAGE:
                doubted.add(block[begin], block[begin + RECORD_HEAD.size : end])
                continue
            _, _, number, sequence, log_time, publish_time = MESSAGE_HEAD.unpack_from(block, begin)
            channel = (known if number in known.channels else doubted).channel(number)
            if topics is None or channel.topic in topics:
                self.n_doubtful[channel.topic] += 1
                self.is_doubtful = True
                data = block[begin + MESSAGE_HEAD.size : end]
                yield Record(channel, sequence, data, log_time, publish_time)
                self.is_doubtful = False

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

    def _is_defined(self, number: int) -> bool:
        """Whether a channel is known, if need be from the summary or the rest of the file."""
        channels = self._definitions.channels
        if number not in channels and number in self._end.definitions.channels:
            self._definitions.complete(self._end.definitions)
        if number not in channels and self._looks_back:
            self._looks_back = False
            other = McapScan(self.path, self.start, self.end, size=self._recorded_size)
            other._looks_back = False
            for _ in other.records(frozenset(), doubtful=self._takes_doubted):
                pass
            self._definitions.complete(other._definitions)
            self._definitions.complete(other._doubted)
        return number in channels

    def _compare_with_end(self, section: DataSection) -> None:
        end, note = self._end, section.note
        self.is_cut = not section.ended and not end.complete
        if not section.ended and not self.log:
            complete = "the data has no end record"
            note(
                complete if end.complete else "the file has no end: the recording was cut off here"
            )
        if section.ended and not end.complete:
            note("the summary at the end of the file is damaged", is_harmless=True)
        for each in end.faults.damage:
            note(each.what, is_harmless=True)
        for fault in self._definitions.faults_of(end.definitions):
            note(f"in the summary, {fault}", is_harmless=True)
        n_missing = len(set(end.index.starts) - section.visited)
        if n_missing:
            note(f"{n_missing} chunks of the summary are missing")
        if end.statistics is None:
            return
        for number, count in end.statistics.channel_message_counts.items():
            if number in self._definitions.channels:
                topic = self._definitions.channels[number].topic
                self.expected_of[topic] = self.expected_of.get(topic, 0) + count
        stated, n_found = end.statistics, self.counts.total()
        if stated.message_count != n_found:
            note(f"{stated.message_count} messages were written, {n_found} are readable")
        elif stated.channel_message_counts and not self.log:
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
            note(fault, is_harmless=True)
        if any(one == other for one, other in pairwise(end.index.starts)):
            note("the summary lists a chunk twice", is_harmless=True)
        copied = [copied_index(window, *each) for each in self.copied]
        for fault in end.index.faults_of_copied(copied):
            note(fault, is_harmless=True)
        stated, found = end.statistics, self._definitions
        if stated is None or self.log:
            return
        n_copied = stated.attachment_count + stated.metadata_count
        for what, n_stated, n_found in (
            ("chunks", stated.chunk_count, len(section.visited)),
            (_COPIED, n_copied, len(self.copied)),
            ("schemas", stated.schema_count, len(found.schemas)),
            ("channels", stated.channel_count, len(found.channels)),
        ):
            if n_stated != n_found:
                note(_DIFFERS.format(n_stated, what, n_found), is_harmless=True)


class _Remains:
    """What looks like records in an area of a file whose checksum does not fit.

    A message counts where its channel is known, its time is within those of its chunk, and no other
    record begins within it; without the head of its chunk, another record must follow it.
    is_known: whether a number is that of a channel.
    """

    def __init__(self, area: Area, is_known: Callable[[int], bool]) -> None:
        self._block, self._start, self._stop = area.block, area.start, area.end
        self._is_known = is_known
        self._first_ns, self._last_ns = 0, (1 << 64) - 1
        self._has_head = area.doubted is not None and area.doubted.first_ns <= area.doubted.last_ns
        if self._has_head and area.doubted is not None:
            self._first_ns, self._last_ns = area.doubted.first_ns, area.doubted.last_ns

    def places(self) -> Iterator[tuple[int, int]]:
        """Yield where in the block each of them begins and ends."""
        place: int | None = self._start
        while place is not None and place < self._stop:
            end = self._end_of(place)
            if end is not None and end < self._stop and self._end_of(end) is None:
                # It is longer than it states where another record begins within it.
                end = end if self._has_head and self._next(place + 1, end) is None else None
            if end is None:
                place = self._next(place + 1, self._stop)
                continue
            yield place, end
            place = end

    def _next(self, place: int, stop: int) -> int | None:
        while (found := RUN_PATTERN.search(self._block, place, stop)) is not None:
            if self._end_of(found.start()) is not None:
                return found.start()
            place = found.start() + 1
        return None

    def _end_of(self, place: int) -> int | None:
        """Where the record ends that seems to begin there."""
        if place + RECORD_HEAD.size > self._stop or self._block[place] not in IN_AREAS:
            return None
        opcode, length = RECORD_HEAD.unpack_from(self._block, place)
        end: int = place + RECORD_HEAD.size + length
        if end > self._stop or (opcode != _MESSAGE and length > LARGEST_DEFINITION):
            return None
        if opcode == _MESSAGE:
            if end < place + MESSAGE_HEAD.size:
                return None
            _, _, channel, _, log_time, _ = MESSAGE_HEAD.unpack_from(self._block, place)
            if not (self._first_ns <= log_time <= self._last_ns and self._is_known(channel)):
                return None
        return end


def _may_begin(block: bytes, place: int, end: int) -> bool:
    """Whether a record may begin there: it has an opcode of the format, or a length below 2^40."""
    return end - place < RECORD_HEAD.size or (
        0 < block[place] <= Opcode.DATA_END
        or (block[place] > 0 and block[place + 6 : place + 9] == b"\0\0\0")
    )


def profile_of(window: FileWindow) -> str:
    """The profile that the header of a file names, empty where there is none."""
    start = MAGIC_SIZE + RECORD_HEAD.size
    size = int.from_bytes(window.read(start, 4), "little")
    return window.read(start + 4, min(size, _LONGEST_PROFILE)).decode(errors="replace")
