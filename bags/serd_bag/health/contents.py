"""What a bag holds, by the summaries and indexes of its files; only without them all is read."""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from serd_bag.damage import FileScan, missing_messages
from serd_bag.formats.mcap.scan import McapScan
from serd_bag.formats.ros1.scan import Ros1Scan
from serd_bag.formats.rosbag2.layout import bag_layout
from serd_bag.formats.sqlite.scan import SqliteScan
from serd_bag.reader import BagReader

#: Of files that state their contents.
_SCANS: dict[str, type[FileScan]] = {".mcap": McapScan, ".bag": Ros1Scan, ".db3": SqliteScan}


@dataclass(frozen=True)
class TopicContents:
    """One topic of a bag; mean_hz: messages per second of the whole bag, None for less than two;
    n_bytes: of its messages, None where they were not read."""

    name: str
    type_name: str
    n_messages: int
    mean_hz: float | None
    n_bytes: int | None = None


@dataclass(frozen=True)
class BagContents:
    """The result of `contents_of_bag`.

    span_s: from the first log time of the bag to the last; faults: of a bag that was read; n_lost:
    messages that are known to be lost.
    """

    path: Path
    topics: tuple[TopicContents, ...]
    span_s: float
    faults: tuple[str, ...] = ()
    n_lost: int = 0

    @property
    def n_messages(self) -> int:
        """Messages by the summaries, or those that are readable."""
        return sum(topic.n_messages for topic in self.topics)


def contents_of_bag(path: str | Path, *, sizes: bool = False) -> BagContents:
    """What a bag holds; damaged bags and those without summary or index are read.

    sizes: read any bag for the bytes of each topic. Raises BagError where there is no bag.
    """
    path = Path(path)
    layout = bag_layout(path)
    scans = [_SCANS[file.suffix](file) for file in layout.files if file.suffix in _SCANS]
    stated = [found for scan in scans if (found := scan.stated()) is not None]
    counts = sum((each.counts for each in stated), Counter[str]())
    n_bytes = _sizes(path) if sizes else None
    types: dict[str, str] = {}
    if len(stated) < len(layout.files) or layout.fault or missing_messages(layout, counts):
        from serd_bag.health.check import check_bag

        check = check_bag(path)
        types = {topic.name: topic.type_name for topic in check.topics}
        counts = Counter({topic.name: topic.n_messages for topic in check.topics})
        span_s, faults, n_lost = check.span_s, check.faults, check.n_lost
    else:
        for each in reversed(stated):
            types.update(each.types)
        filled = [each for each in stated if each.counts.total()]
        last_ns = max((each.last_ns for each in filled), default=0)
        first_ns = min((each.first_ns for each in filled), default=0)
        span_s, faults, n_lost = (last_ns - first_ns) / 1e9, (), 0
    rows = (
        TopicContents(
            *(name, types[name], count),
            (count - 1) / span_s if count > 1 and span_s else None,
            None if n_bytes is None else n_bytes[name],
        )
        for name in sorted(types)
        for count in [counts[name]]
    )
    return BagContents(path, tuple(rows), span_s, faults, n_lost)


def _sizes(path: Path) -> Counter[str]:
    found: Counter[str] = Counter()
    for record in BagReader(path, tolerant=True).records():
        found[record.channel.topic] += len(record.data)
    return found
