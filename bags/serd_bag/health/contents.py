"""What a bag holds, by the summaries at the ends of its files; only without them all is read."""

from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

from serd_bag.damage import missing_messages
from serd_bag.formats.mcap.file_end import FileEnd
from serd_bag.formats.rosbag2.layout import bag_layout
from serd_bag.health.check import check_bag


@dataclass(frozen=True)
class TopicContents:
    """mean_hz: messages per second of the whole bag, None for less than two messages."""

    name: str
    type_name: str
    n_messages: int
    mean_hz: float | None


@dataclass(frozen=True)
class BagContents:
    """span_s: from the first log time of the bag to the last; faults: of a bag that was read.

    n_lost: messages that are known to be lost.
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


def contents_of_bag(path: str | Path) -> BagContents:
    """The contents; bags other than MCAP, damaged ones and those without summary are read."""
    path = Path(path)
    layout = bag_layout(path)
    ends = []
    for file in layout.files:
        ends.append(FileEnd(file) if file.suffix == ".mcap" else None)
        if ends[-1] is None or not ends[-1].states_contents:
            return _of_all_messages(path)
    known = [end for end in ends if end is not None]
    counts = sum((_counts(end) for end in known), Counter[str]())
    if layout.fault or missing_messages(layout, counts):
        return _of_all_messages(path)
    types = {topic.name: topic.type_name for end in known for topic in end.definitions.topics()}
    filled = [each for end in known if (each := end.statistics) and each.message_count]
    last_ns = max((each.message_end_time for each in filled), default=0)
    first_ns = min((each.message_start_time for each in filled), default=0)
    return _contents(path, {name: (types[name], counts[name]) for name in types},
                     (last_ns - first_ns) / 1e9)  # fmt: skip


def _counts(end: FileEnd) -> Counter[str]:
    found: Counter[str] = Counter()
    if end.statistics:
        for number, count in end.statistics.channel_message_counts.items():
            found[end.definitions.channels[number].topic] += count
    return found


def _of_all_messages(path: Path) -> BagContents:
    check = check_bag(path)
    topics = {topic.name: (topic.type_name, topic.n_messages) for topic in check.topics}
    return replace(_contents(path, topics, check.span_s), faults=check.faults, n_lost=check.n_lost)


def _contents(path: Path, topics: dict[str, tuple[str, int]], span_s: float) -> BagContents:
    rows = (
        TopicContents(name, kind, count, (count - 1) / span_s if count > 1 and span_s else None)
        for name, (kind, count) in sorted(topics.items())
    )
    return BagContents(path, tuple(rows), span_s)
