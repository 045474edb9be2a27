"""Checks of a whole recording: damage, counts, gaps, clocks.

The stamp of a message is that of the std_msgs/Header it begins with; its log time is when the
recorder received it. Stamps that step back, jump or drift against the log times indicate two
clocks.
"""

from array import array
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bags.damage import at_most
from bags.errors import BagError
from bags.formats.limits import MOST_FAULTS
from bags.formats.rosbag2.message_types import ENCODING, message_type
from bags.health.topic_check import TopicCheck, TwoClocks, check_topic
from bags.messages.plain import message_stamp_ns
from bags.messages.times import AGREEMENT_S
from bags.reader import BagReader
from bags.topic import Topic, nearest_topic, topics_named

#: Messages whose times are kept in memory.
_MOST_COMPARED = 1_000_000
#: Characters of a definition in which its first field is sought.
_LONGEST_BEGINNING = 20_000
_NO_CHECKSUMS = (
    "a part of the bag has no checksums: changed bytes in it cannot be detected; 'serd bag convert'"
    " adds checksums"
)


@dataclass(frozen=True)
class BagCheck:
    """faults: why the bag is not sound; remarks: what to know before learning from it."""

    path: Path
    topics: tuple[TopicCheck, ...]
    faults: tuple[str, ...]
    remarks: tuple[str, ...]

    @property
    def sound(self) -> bool:
        """Whether there is no fault."""
        return not self.faults

    @property
    def span_s(self) -> float:
        """From the first log time of any topic to the last."""
        filled = [topic for topic in self.topics if topic.n_messages]
        first_s = min((topic.first_s for topic in filled), default=0.0)
        return max((topic.last_s for topic in filled), default=0.0) - first_s

    @property
    def n_messages(self) -> int:
        """Readable messages."""
        return sum(topic.n_messages for topic in self.topics)


def check_bag(path: str | Path, required: Sequence[str] = ()) -> BagCheck:
    """Read the whole bag; `required`: topics that must have messages.

    A name that begins with "/" is one topic, any other a topic of that name in any namespace.
    """
    reader = BagReader(path, tolerant=True, thorough=True)
    times = {name: (array("q"), array("q")) for name in reader.topics}
    stamped = {name: _has_header(topic) for name, topic in reader.topics.items()}
    faults: list[str] = []
    further: Counter[str] = Counter()
    n_compared = 0
    try:
        for message in reader.messages():
            if n_compared == _MOST_COMPARED:
                further[message.topic] += 1
                continue
            n_compared += 1
            logs, stamps = times[message.topic]
            logs.append(message.log_time_ns)
            if stamped[message.topic]:
                stamps.append(_stamp_ns(message.data))
    except BagError as error:
        faults.append(str(error))
    faults += [each.sentence() for each in reader.damage]
    known = sorted(reader.topics.items())
    topics = tuple(check_topic(topic, *times[name], further[name]) for name, topic in known)
    faults += _missing(topics, required)
    remarks = _remarks(topics)
    if further:
        remarks.append(f"rates, gaps and clocks are those of the first {n_compared} messages")
    if topics and not reader.has_checksums:
        remarks.append(_NO_CHECKSUMS)
    lines = (tuple(at_most(each, MOST_FAULTS)) for each in (faults, remarks))
    return BagCheck(Path(path), topics, *lines)


def _missing(topics: Sequence[TopicCheck], required: Sequence[str]) -> list[str]:
    filled = [topic.name for topic in topics if topic.n_messages]
    empty = [topic.name for topic in topics if not topic.n_messages]
    faults = []
    for name in required:
        if not topics_named(filled, name):
            near = None if topics_named(empty, name) else nearest_topic(filled, name)
            fix = f"; did you mean {near!r}?" if near else ""
            faults.append(f"topic {name} has no message{fix}")
    return faults


def _remarks(topics: Sequence[TopicCheck]) -> list[str]:
    remarks = []
    for topic in topics:
        if not topic.n_messages:
            remarks.append(f"{topic.name}: no message")
        if topic.n_gaps:
            gaps = "1 gap" if topic.n_gaps == 1 else f"{topic.n_gaps} gaps"
            remarks.append(f"{topic.name}: {gaps}, the longest {topic.longest_gap_s:.2f} s")
        if topic.n_log_steps_back:
            remarks.append(f"{topic.name}: log time steps back {_times(topic.n_log_steps_back)}")
        if topic.n_stamp_steps_back:
            remarks.append(f"{topic.name}: stamps step back {_times(topic.n_stamp_steps_back)}")
        remarks += [f"{topic.name}: {remark}" for remark in _clock_remarks(topic.clocks)]
    return remarks + _offset_remarks(topics)


def _offset_remarks(topics: Sequence[TopicCheck]) -> list[str]:
    """Clocks that differ by a constant; that of log times may be the one that differs."""
    compared = [topic for topic in topics if topic.clocks.span_s]
    offsets_s = {each.name: each.clocks.offset_s for each in compared if each.clocks.offset_s}
    ahead_s = list(offsets_s.values())
    if len(compared) > 1 and len(ahead_s) == len(compared) and np.ptp(ahead_s) <= AGREEMENT_S:
        return [
            f"all stamps are {_ahead(ahead_s[0])} log times: those of another or simulated time"
        ]
    return [
        f"{name}: stamps are {_ahead(offset_s)} log times: the clock of its sender is wrong"
        for name, offset_s in offsets_s.items()
    ]


def _ahead(offset_s: float) -> str:
    return f"{abs(offset_s):.2f} s {'ahead of' if offset_s > 0 else 'behind'}"


def _clock_remarks(clocks: TwoClocks) -> list[str]:
    remarks = []
    if clocks.jumps_s:
        largest_s = max(clocks.jumps_s, key=abs)
        way = "forward" if largest_s > 0 else "back"
        often = "" if len(clocks.jumps_s) == 1 else f" {_times(len(clocks.jumps_s))}, the largest"
        remarks.append(f"stamps jump against log times{often} {way} by {abs(largest_s):.2f} s")
    if clocks.drift_s:
        way = "ahead of" if clocks.drift_s > 0 else "behind"
        remarks.append(
            f"stamps run {way} log times by {abs(clocks.drift_s):.2f} s in {clocks.span_s:.0f} s"
        )
    return remarks


def _times(number: int) -> str:
    return "once" if number == 1 else f"{number} times"


def _has_header(topic: Topic) -> bool:
    definition = topic.message_type
    if not definition.text:
        try:
            definition = message_type(definition.name)
        except BagError:
            return False
    return definition.encoding == ENCODING and _begins_with_header(definition.text)


def _begins_with_header(text: str) -> bool:
    fields = (line.split("#")[0].split() for line in text[:_LONGEST_BEGINNING].splitlines())
    first: list[str] = next((words for words in fields if len(words) >= 2), [])
    return bool(first) and first[0] in ("std_msgs/Header", "std_msgs/msg/Header", "Header")


def _stamp_ns(data: bytes) -> int:
    try:
        return message_stamp_ns(data)
    except BagError:
        return 0
