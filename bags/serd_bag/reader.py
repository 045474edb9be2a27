"""Messages of any rosbag2 or ROS 1 bag, compressed or not, with all damage found on the way.

Three steps: scan the records of each file, decompress messages, compare counts with metadata.yaml.
The order is that of the files; log times step back where the recorder received them so. Outside of
MCAP rosbag2 compresses whole storage files or single messages by zstd.
"""

import shutil
import tempfile
import weakref
from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import replace
from pathlib import Path

import zstandard

from serd_bag.damage import Damage, FileScan, Losses, losses, missing_messages
from serd_bag.errors import BagError, DamagedBagError, disk_errors
from serd_bag.formats.limits import LARGEST_CONTENT, MOST_FAULTS, most_unpacked
from serd_bag.formats.mcap.scan import McapScan
from serd_bag.formats.ros1.scan import Ros1Scan
from serd_bag.formats.rosbag2.layout import COMPRESSED_FILE, ROS1_SUFFIX, BagLayout, bag_layout
from serd_bag.formats.sqlite.scan import SqliteScan
from serd_bag.topic import RawMessage, Topic

#: Bytes of which zstd makes 32 MiB at most.
_PIECE = 1024
#: A compressed message begins with these bytes, an uncompressed CDR message with a zero.
_COMPRESSED = zstandard.FRAME_HEADER


class BagReader:
    """Reads the messages of a bag folder, or of a single .mcap, .db3 or .bag file.

        reader = BagReader("drive")
        for topic, type_name, data, log_time_ns, publish_time_ns in reader.messages(["/odom"]):
            ...  # data: CDR bytes, see `serd_bag.messages.plain.decode`

    tolerant: continue past damage and collect it in `damage`; otherwise damage raises a
    DamagedBagError when it is found, which for missing messages is at the end. thorough: compare
    the index of messages with the messages too. BagError where there is no bag.

    topics: by their full names. Once all messages were read, losses: what is missing;
    has_checksums: whether all have them; copied: (file, (offset, length) of each of its sound
    attachments and metadata records).
    """

    def __init__(self, path: str | Path, *, tolerant: bool = False, thorough: bool = False) -> None:
        self.path = Path(path)
        self.tolerant = tolerant
        self.damage: list[Damage] = []
        self.losses = Losses()
        self.has_checksums = True
        self.copied: list[tuple[Path, list[tuple[int, int]]]] = []
        self.layout: BagLayout = bag_layout(path)
        self._thorough = thorough
        if self.layout.fault:
            self._report([Damage(self.path, None, self.layout.fault)])
        self._folder: Path | None = None
        #: what is read in place of each file
        self._paths = [self._readable(*each) for each in enumerate(self.layout.files)]
        self.topics: dict[str, Topic] = {topic.name: topic for topic in self._topics()}

    def messages(self, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
        """Messages of the given topics (full names), None for all, in the order of the files."""
        wanted = None if topics is None else frozenset(topics)
        scans: list[tuple[Path, FileScan]] = []
        self.copied = []
        for file, scan in self._scans():
            broken: Counter[str] = Counter()
            for message in scan.messages(wanted):
                if not message.data.startswith(_COMPRESSED):
                    yield message
                elif (data := _decompressed(message.data)) is not None:
                    yield message._replace(data=data)
                else:
                    broken[message.topic] += 1
            scan.counts.subtract(broken)
            scan.n_left_out += broken.total()
            scans.append((file, scan))
            self.has_checksums &= scan.has_checksums
            self.copied.append((scan.path, scan.copied))
            self._report(scan.damage, file)
            if broken:
                what = f"{broken.total()} compressed messages cannot be unpacked"
                self._report([Damage(file, None, what)])
        self.losses = losses(self.layout, scans)
        counts = sum((scan.counts for _, scan in scans), Counter())
        missing = [] if self.damage else missing_messages(self.layout, counts)
        self._report([Damage(self.path, None, what) for what in missing])

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

    def _topics(self) -> Iterator[Topic]:
        for file, scan in self._scans():
            yield from scan.topics()
            if not self.tolerant:
                self._report(scan.damage, file)

    def _scans(self) -> Iterator[tuple[Path, FileScan]]:
        """Each file of the bag and what reads it."""
        for file, path in zip(self.layout.files, self._paths, strict=True):
            if path.suffix == ".mcap":
                yield file, McapScan(path, thorough=self._thorough, size=file.stat().st_size)
            elif path.suffix == ROS1_SUFFIX:
                yield file, Ros1Scan(path)
            else:
                yield file, SqliteScan(path, thorough=self._thorough or self.tolerant)

    def _report(self, damage: list[Damage], file: Path | None = None) -> None:
        """Collect damage, or raise it; `file` is named in place of its decompressed copy."""
        found = damage if file is None else [replace(each, path=file) for each in damage]
        if found and not self.tolerant:
            advice = "" if found[0].fix else "; repair it with 'serd bag recover'"
            raise DamagedBagError(found[0].sentence() + advice)
        self.damage.extend(found)
        del self.damage[MOST_FAULTS:]


def _decompressed(data: bytes) -> bytes | None:
    """The content of one compressed message, None where it is damaged."""
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
