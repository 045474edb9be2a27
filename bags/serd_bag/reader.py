"""Messages of any rosbag2 or ROS 1 bag, compressed or not, with all damage found on the way.

Three steps: scan the records of each file, decompress messages, compare counts with metadata.yaml.
The order is that of the files; log times step back where the recorder received them so. Outside of
MCAP rosbag2 compresses whole storage files or single messages by zstd.
"""

import shutil
import tempfile
import weakref
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import zstandard

from serd_bag.damage import Damage, FileScan, Losses, losses, missing_messages
from serd_bag.errors import BagError, DamagedBagError, disk_errors
from serd_bag.formats.limits import LARGEST_CONTENT, MOST_FAULTS, most_unpacked
from serd_bag.formats.mcap.scan import McapScan
from serd_bag.formats.ros1.scan import Ros1Scan
from serd_bag.formats.rosbag2.layout import (
    COMPRESSED_FILE,
    ROS1_SUFFIX,
    BagLayout,
    anything_layout,
    bag_layout,
    is_bag_file,
    is_recording,
    storage_kind,
)
from serd_bag.formats.sqlite.scan import SqliteScan
from serd_bag.topic import CDR, ROS1, Channel, RawMessage, Record, Topic, topic_of

if TYPE_CHECKING:
    from serd_bag.rescue.carve import Part

#: Bytes of which zstd makes 32 MiB at most.
_PIECE = 1024
#: A compressed message begins with these bytes, an uncompressed CDR message with a zero.
_COMPRESSED = zstandard.FRAME_HEADER
_MAKE = tuple.__new__
#: Name of the MCAP metadata record of a recorder that was paused, and its values: the log times of
#: the last message before and of the first one after the pause.
PAUSE, AFTER_NS, BEFORE_NS = "serd_bag_pause", "after_ns", "before_ns"


class BagReader:
    """Reads the messages of a bag folder, or of a single .mcap, .db3 or .bag file.

        reader = BagReader("drive")
        for topic, type_name, data, log_time_ns, publish_time_ns in reader.messages(["/odom"]):
            ...  # data: CDR bytes, see `serd_bag.messages.plain.decode`

    carve: find recordings in any file, or in all files of a folder, by what stands in them.
    tolerant: continue past damage and collect it in `damage`; otherwise damage raises a
    DamagedBagError when it is found, which for missing messages is at the end. thorough: compare
    the index of messages with the messages too. BagError where there is no bag.

    topics: by their full names. Once all messages were read, losses: what is missing;
    has_checksums: whether all have them; scans: what was found in each file.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        tolerant: bool = False,
        thorough: bool = False,
        carve: bool = False,
    ) -> None:
        self.path = Path(path)
        self.tolerant = tolerant
        self.damage: list[Damage] = []
        self.losses = Losses()
        self.has_checksums = True
        self.scans: list[tuple[Path, FileScan]] = []
        self.layout: BagLayout = anything_layout(path) if carve else bag_layout(path)
        self._thorough = thorough
        mode = (self.layout.metadata or {}).get("compression_mode", "MESSAGE")
        self._packs_messages = str(mode).upper() == "MESSAGE"
        if self.layout.fault:
            self._report([Damage(self.path, None, self.layout.fault)])
        self._folder: Path | None = None
        #: what is read in place of each file
        self.paths = [self._readable(*each) for each in enumerate(self.layout.files)]
        self.parts = [
            (file, path, part)
            for file, path in zip(self.layout.files, self.paths, strict=True)
            for part in (_parts_of(file, path) if carve else [None])
        ]
        self.profile = "ros2"
        self._channels = dict.fromkeys(self._found_channels())
        self.topics: dict[str, Topic] = {}
        for channel in self._channels:
            if channel.topic not in self.topics:
                self.topics[channel.topic] = topic_read(channel)

    def messages(self, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
        """Messages of the given topics (full names), None for all, in the order of the files.

        Those of ROS 1 become the ROS 2 messages of the same fields; no others are changed. Of a
        given topic with several types the messages of the first are returned, which `topics` names.
        """
        n_broken = n_others = 0
        first = {each.topic: each for each in reversed(self._channels)}
        others = {each for each in self._channels if not _are_alike(each, first[each.topic])}
        if topics is None:
            others.clear()
        is_plain = not others and all(each.encoding != ROS1 for each in self._channels)
        for scan, records in self.walks(topics):
            if is_plain and not self._packs_messages and isinstance(scan, SqliteScan):
                yield from scan.messages(None if topics is None else frozenset(topics))
                continue
            for record in records:
                channel, _, data, log_time_ns, publish_time_ns = record
                if others and channel in others:
                    n_others += 1
                elif channel.encoding != ROS1:
                    # NamedTuple's own constructor takes twice as long.
                    values = (channel.topic, channel.type_name, data, log_time_ns, publish_time_ns)
                    yield _MAKE(RawMessage, values)
                elif (message := message_of(record)) is not None:
                    yield message
                else:
                    n_broken += 1
        if n_broken:
            what = f"{n_broken} messages do not fit the definition of their type"
            self._report([Damage(self.path, None, what)])
        if n_others:
            what = f"{n_others} messages are of another type than the first of their topic"
            self._report([Damage(self.path, None, what, is_harmless=True)])

    def records(
        self, topics: Collection[str] | None = None, *, doubtful: bool = False
    ) -> Iterator[Record]:
        """Messages of the given topics exactly as the files hold them, without interpreting any.

        doubtful: those too that are of a damaged part, as far as they can be found there. The last
        of `scans` states whether the message that was given last is one.
        """
        for _, records in self.walks(topics, doubtful=doubtful):
            yield from records

    def walks(
        self, topics: Collection[str] | None = None, *, doubtful: bool = False
    ) -> Iterator[tuple[FileScan, Iterator[Record]]]:
        """Each file, or recording in a file, with its messages, which must be read to the end."""
        wanted = None if topics is None else frozenset(topics)
        self.scans = []
        for file, scan in self._scans():
            self.scans.append((file, scan))
            found = scan.records(wanted, doubtful=doubtful)
            yield scan, _unpacked_records(scan, found) if self._packs_messages else found
            self.has_checksums &= scan.has_checksums
            self._report(scan.log.damage, file)
        self.losses = losses(self.layout, self.scans)
        counts = sum((scan.counts for _, scan in self.scans), Counter())
        missing = [] if self.damage else missing_messages(self.layout, counts)
        self._report([Damage(self.path, None, what) for what in missing])

    @property
    def pauses_ns(self) -> list[tuple[int, int]]:
        """Log times of the last message before each pause of the recorder, and of the first one
        after it; complete once all messages were read."""
        records = [each for _, scan in self.scans for each in scan.metadata()]
        pairs = [
            (v.get(AFTER_NS, ""), v.get(BEFORE_NS, "")) for name, v in records if name == PAUSE
        ]
        return [(int(one), int(two)) for one, two in pairs if f"{one}{two}".isdecimal()]

    @property
    def channels(self) -> list[Channel]:
        """All channels of all files, each once, in the order of the files."""
        return list(self._channels)

    def _readable(self, number: int, file: Path) -> Path:
        """The file, or its decompressed copy, which is removed with the reader."""
        if file.suffix != COMPRESSED_FILE:
            return file
        if self._folder is None:
            self._folder = Path(tempfile.mkdtemp(prefix="serd-bag-"))
            weakref.finalize(self, shutil.rmtree, self._folder, ignore_errors=True)
        target = self._folder / f"{number}_{file.stem}"
        with disk_errors("unpack", file, BagError):
            fault = _decompress(file, target)
        if fault:
            self._report([Damage(file, None, fault)])
        return target

    def _found_channels(self) -> Iterator[Channel]:
        for number, (file, scan) in enumerate(self._scans()):
            if number == 0:
                self.profile = scan.profile
            yield from scan.channels()
            if not self.tolerant:
                self._report(scan.log.damage, file)

    def _scans(self) -> Iterator[tuple[Path, FileScan]]:
        """Each file of the bag, or recording in a file, and what reads it."""
        for file, path, part in self.parts:
            kind, start, end = (storage_kind(path), 0, None) if part is None else part
            if kind == ".mcap":
                size = file.stat().st_size
                yield file, McapScan(path, start, end, thorough=self._thorough, size=size)
            elif kind == ROS1_SUFFIX:
                yield file, Ros1Scan(path, start, end)
            else:
                is_thorough = self._thorough or self.tolerant
                yield file, SqliteScan(path, start, end, thorough=is_thorough)

    def _report(self, damage: list[Damage], file: Path | None = None) -> None:
        """Collect damage, or raise it; `file` is named in place of its decompressed copy."""
        found = damage if file is None else [replace(each, path=file) for each in damage]
        costly = [each for each in found if not each.is_harmless]
        if costly and not self.tolerant:
            advice = "" if costly[0].fix else "; save what it holds with 'serd-bag rescue'"
            raise DamagedBagError(costly[0].sentence() + advice)
        self.damage.extend(found)
        del self.damage[MOST_FAULTS:]


def _unpacked_records(scan: FileScan, found: Iterator[Record]) -> Iterator[Record]:
    """The records with the content of compressed messages, of which broken ones are left out."""
    broken: Counter[str] = Counter()
    for record in found:
        if record[2][:4] != _COMPRESSED or record[0].encoding != CDR:
            yield record
        elif (data := _decompressed(record.data)) is not None:
            yield record._replace(data=data)
        else:
            broken[record.channel.topic] += 1
    scan.counts.subtract(broken)
    scan.n_left_out += broken.total()
    if broken:
        scan.log.note(None, f"{broken.total()} compressed messages cannot be unpacked")


def _parts_of(file: Path, path: Path) -> "Sequence[Part | None]":
    """The recordings in a file; None stands for a whole file that is one."""
    from serd_bag.rescue.carve import recordings_in

    if is_bag_file(file) and is_recording(path):
        return [None]
    kind = storage_kind(path) if is_bag_file(file) else ""
    return recordings_in(path, kind) or ([None] if kind else [])


def _are_alike(one: Channel, other: Channel) -> bool:
    """Whether two channels have one type, by all but the comments of their definitions."""
    if one.type_name != other.type_name or not (one.schema and other.schema):
        return one.type_name == other.type_name
    first, second = (
        [line.split(b"#")[0].split() for line in each.schema.splitlines()] for each in (one, other)
    )
    return list(filter(None, first)) == list(filter(None, second))


def message_of(record: Record) -> RawMessage | None:
    """The message of a record, of ROS 1 in CDR; None where it does not fit its definition."""
    channel, _, data, log_time_ns, publish_time_ns = record
    type_name = channel.type_name
    if channel.encoding == ROS1:
        from serd_bag.formats.ros1.conversion import converted, converted_topic

        made = converted(channel, data)
        if made is None:
            return None
        data, type_name = made, converted_topic(channel).type_name
    return RawMessage(channel.topic, type_name, data, log_time_ns, publish_time_ns)


def topic_read(channel: Channel) -> Topic:
    """The topic of a channel as its messages are read, of ROS 1 that of ROS 2."""
    if channel.encoding != ROS1:
        return topic_of(channel)
    from serd_bag.formats.ros1.conversion import converted_topic

    return converted_topic(channel)


def _decompressed(data: bytes) -> bytes | None:
    try:
        if zstandard.frame_content_size(data) > LARGEST_CONTENT:
            return None
        return zstandard.ZstdDecompressor().decompress(data, max_output_size=LARGEST_CONTENT)
    except (zstandard.ZstdError, MemoryError):
        return None


def _decompress(file: Path, target: Path) -> str:
    """Write as much of the content as can be decompressed and a file of its size may hold.

    Returns why that is not all of it, an empty text where it is.
    """
    left = most_unpacked(file.stat().st_size)
    with file.open("rb") as source, target.open("wb") as copy:
        decompressor = zstandard.ZstdDecompressor().decompressobj()
        try:
            while (piece := source.read(_PIECE)) and left > 0:
                left -= copy.write(decompressor.decompress(piece)[:left])
        except zstandard.ZstdError as error:
            return f"it cannot be unpacked ({error})"
    if left <= 0:
        return "it unpacks to more than a file of its size can hold; the rest is not read"
    return "" if decompressor.eof else "the compressed file is cut off"
