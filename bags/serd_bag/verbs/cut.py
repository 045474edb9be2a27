"""Parts of one bag, or of several merged, as a new bag; every message is copied as it is."""

import heapq
import math
import re
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from serd_bag.command.rewrite import RewriteReport
from serd_bag.errors import BagError
from serd_bag.formats.mcap.writer import Compression
from serd_bag.reader import BagReader
from serd_bag.rescue.saving import kept_metadata
from serd_bag.topic import Record
from serd_bag.writer import BagWriter, new_folder

_SECOND_NS = 1_000_000_000
#: Bytes of messages that are sorted at once.
_BATCH = 64 << 20
#: Seconds from here on are those of a clock, not of the bag.
_CLOCK_S = 1e8


@dataclass(frozen=True)
class Selection:
    """The messages to take of a bag.

    topics, without: regular expressions that match whole names, of the topics to take, all without
    one, and of those to leave out. from_s, to_s: log time after the first message of the bag, or
    time of the clock where it is above 1e8 s; BagError where an expression cannot be read.
    """

    topics: Sequence[str] = ()
    without: Sequence[str] = ()
    from_s: float = -math.inf
    to_s: float = math.inf

    def names(self, available: Iterable[str]) -> frozenset[str]:
        """The topics to take; BagError where an expression matches none, or no time is taken."""
        if self.from_s >= self.to_s:
            raise BagError(f"--from must be below --to, got {self.from_s:g} and {self.to_s:g}")
        names = list(available)
        try:
            wanted = [re.compile(each) for each in self.topics]
            left_out = [re.compile(each) for each in self.without]
        except re.error as error:
            raise BagError(f"topics must be regular expressions, got {error.pattern!r}") from None
        for expression in wanted:
            if not any(map(expression.fullmatch, names)):
                known = ", ".join(sorted(names)) or "nothing"
                raise BagError(f"{expression.pattern!r} must match a topic, the bag holds {known}")
        return frozenset(
            name
            for name in names
            if (not wanted or any(each.fullmatch(name) for each in wanted))
            and not any(each.fullmatch(name) for each in left_out)
        )

    def records(self, reader: BagReader) -> Iterator[Record]:
        """Its messages, in the order of the bag."""
        first_ns: int | None = None
        of_clock = any(_CLOCK_S < abs(each) < math.inf for each in (self.from_s, self.to_s))
        names = self.names(reader.topics)
        for record in reader.records():
            first_ns = record.log_time_ns if first_ns is None else first_ns
            time_s = (record.log_time_ns - (0 if of_clock else first_ns)) / _SECOND_NS
            if self.from_s <= time_s < self.to_s and record.channel.topic in names:
                yield record


def cut(
    sources: Sequence[str | Path],
    target: str | Path,
    selection: Selection | None = None,
    *,
    split_bytes: int | None = None,
    sort: bool = False,
    compression: Compression = "none",
) -> RewriteReport:
    """Write the selected messages of bags as one new bag; several bags are merged by log time.

        cut(["drive"], "front", Selection(topics=["/camera/.*", "/tf.*"], to_s=60))

    split_bytes: size at which the next file is started; sort: by log time, where a bag is not.
    Messages, channels, attachments and metadata records stay as they are. BagError where a bag is
    damaged or missing, and where `target` is neither new nor empty.
    """
    selection = selection or Selection()
    readers = [BagReader(source) for source in sources]
    with new_folder(Path(target)) as folder, tempfile.TemporaryDirectory() as runs:
        profile = readers[0].profile
        with BagWriter(
            folder, max_file_bytes=split_bytes, compression=compression, profile=profile
        ) as writer:
            streams = [selection.records(reader) for reader in readers]
            merged = streams[0] if len(streams) == 1 else heapq.merge(*streams, key=_log_time)
            _declare(writer, readers, selection)
            n_before = 0
            for record in _sorted(merged, Path(runs)) if sort else merged:
                writer.write_record(record)
                if split_bytes is not None and writer.size - n_before >= split_bytes:
                    writer.flush()
                    n_before = writer.size
            for reader in readers:
                writer.kept = writer.kept or kept_metadata(reader)
                for _, scan in reader.scans:
                    writer.copy_records(scan)
    source = Path(", ".join(map(str, sources)))
    return RewriteReport(source, Path(target).resolve(), dict(writer.counts), ())


def _declare(writer: BagWriter, readers: Iterable[BagReader], selection: Selection) -> None:
    """Declare the channels of all selected topics, also of those without messages."""
    for reader in readers:
        names = selection.names(reader.topics)
        for channel in reader.channels:
            if channel.topic in names:
                writer.add_channel(channel)


def _log_time(record: Record) -> int:
    return record.log_time_ns


def _sorted(records: Iterable[Record], folder: Path) -> Iterator[Record]:
    """The records by log time; sorted batches are kept in bags until they are merged."""
    batch: list[Record] = []
    runs: list[Path] = []
    size = 0
    for record in records:
        batch.append(record)
        size += len(record.data)
        if size > _BATCH:
            runs.append(folder / str(len(runs)))
            with BagWriter(runs[-1]) as writer:
                for each in sorted(batch, key=_log_time):
                    writer.write_record(each)
            batch, size = [], 0
    others = (BagReader(run).records() for run in runs)
    yield from heapq.merge(*others, sorted(batch, key=_log_time), key=_log_time)
