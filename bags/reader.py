"""Messages of any rosbag2 or ROS 1 bag, compressed or not, with all damage found on the way.

Three steps: scan the records of each file, decompress messages, compare counts with metadata.yaml.
The order is that of the files; log times step back where the recorder received them so.
"""

import weakref
from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import replace
from pathlib import Path

from bags.damage import Damage, FileCount, Losses, losses, missing_messages
from bags.errors import DamagedBagError
from bags.formats.limits import MOST_FAULTS
from bags.formats.mcap.scan import McapScan
from bags.formats.ros1.scan import Ros1Scan
from bags.formats.rosbag2.compression import DecompressedFiles, Decompression
from bags.formats.rosbag2.layout import ROS1_SUFFIX, BagLayout, bag_layout
from bags.formats.sqlite.scan import SqliteScan
from bags.topic import RawMessage, Topic


class BagReader:
    """Reads a bag folder, or a single file of one.

    tolerant: continue past damage and collect it in `damage`; otherwise damage raises a
    DamagedBagError when it is found, which for missing messages is at the end.
    thorough: compare the index of messages with the messages too.
    losses: what is missing, once all messages were read; has_checksums: then whether all have them.
    copied: then (file, (offset, length) of each of its sound attachments and metadata records).
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
        self._files = DecompressedFiles(self.layout.files)
        weakref.finalize(self, self._files.close)
        if self.layout.fault:
            self._report([Damage(self.path, None, self.layout.fault)])
        self._report(self._files.damage)
        self.topics: dict[str, Topic] = {topic.name: topic for topic in self._topics()}

    def messages(self, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
        """Messages of the given topics, None for all."""
        wanted = None if topics is None else frozenset(topics)
        counts: Counter[str] = Counter()
        files: list[FileCount] = []
        self.copied = []
        for file, scan in self._scans():
            unpacking = Decompression()
            yield from unpacking.messages(scan.messages(wanted))
            self.has_checksums &= scan.has_checksums
            counts.update(scan.counts)
            n_read = scan.counts.total() - unpacking.n_broken
            files.append(FileCount(file, n_read, scan.expected))
            if isinstance(scan, McapScan):
                self.copied.append((scan.path, scan.copied))
            self._report(scan.damage, file)
            if unpacking.n_broken:
                what = f"{unpacking.n_broken} compressed messages cannot be unpacked"
                self._report([Damage(file, None, what)])
        self.losses = losses(self.layout, files)
        missing = [] if self.damage else missing_messages(self.layout, counts)
        self._report([Damage(self.path, None, what) for what in missing])

    def _topics(self) -> Iterator[Topic]:
        for file, scan in self._scans():
            yield from scan.topics()
            if not self.tolerant:
                self._report(scan.damage, file)

    def _scans(self) -> Iterator[tuple[Path, McapScan | SqliteScan | Ros1Scan]]:
        """Each file of the bag and what reads it."""
        for file, path in zip(self.layout.files, self._files.paths, strict=True):
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
            raise DamagedBagError(f"{found[0].sentence()}; repair it with 'serd bag recover'")
        self.damage.extend(found)
        del self.damage[MOST_FAULTS:]
