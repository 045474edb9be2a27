"""What a bag holds, by the summaries at the ends of its files; only without them all is read."""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from serd_bag.damage import missing_messages
from serd_bag.formats.mcap.file_end import FileEnd
from serd_bag.formats.rosbag2.layout import bag_layout
from serd_bag.reader import BagReader


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
    """What a bag holds; bags other than MCAP, damaged ones and those without summary are read.

    sizes: read any bag for the bytes of each topic. Raises BagError where there is no bag.
    """
    path = Path(path)
    layout = bag_layout(path)
    ends = [FileEnd(file) for file in layout.files if file.suffix == ".mcap"]
    is_stated = len(ends) == len(layout.files) and all(end.states_contents for end in ends)
    counts: Counter[str] = Counter()
    n_bytes = _sizes(path) if sizes else None
    types: dict[str, str] = {}
    stated = [(end.definitions, end.statistics) for end in ends if is_stated and end.statistics]
    for definitions, statistics in stated:
        for channel in definitions.all():
            types.setdefault(channel.topic, channel.type_name)
        for number, count in statistics.channel_message_counts.items():
            counts[definitions.channels[number].topic] += count
    if not is_stated or layout.fault or missing_messages(layout, counts):
        from serd_bag.health.check import check_bag

        check = check_bag(path)
        types = {topic.name: topic.type_name for topic in check.topics}
        counts = Counter({topic.name: topic.n_messages for topic in check.topics})
        span_s, faults, n_lost = check.span_s, check.faults, check.n_lost
    else:
        filled = [statistics for _, statistics in stated if statistics.message_count]
        last_ns = max((each.message_end_time for each in filled), default=0)
        first_ns = min((each.message_start_time for each in filled), default=0)
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
