"""What is good and bad about a recording: damage, counts, gaps, clocks.

Stamps are those at the beginning of each message that has a std_msgs/Header first; log times are
when the recorder received it. A stamp that steps back, or that drifts against the log time, tells
of two clocks.
"""

from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from bags.errors import BagError
from bags.layout import storage_name
from bags.message_types import ENCODING
from bags.reader import BagReader, RawMessage
from bags.topic_definition import kept_definition
from bags.topic_info import TopicInfo
from serd_core.arrays import FloatArray

_SECOND_NS = 1_000_000_000
#: A gap is this many times the usual distance of a topic's messages, and at least this long.
_GAP_FACTOR, _SHORTEST_GAP_S = 5.0, 0.5
#: Messages closer together came in one burst, or got one log time for want of stamps of their own.
_BURST_S = 1e-3

_NO_CHECKSUMS = (
    "sqlite3 files have no checksums: changed bytes within messages cannot be noticed;"
    " 'serd bag convert' gives the messages some"
)


@dataclass(frozen=True)
class TopicCheck:
    """rate_hz: from the usual distance of bursts and their usual size.

    longest_gap_s: between log times; n_gaps: unusual ones.
    n_log_steps_back, n_stamp_steps_back: times the clock went backwards.
    stamp_delay_s: log time minus stamp, (least, greatest); None where there are no stamps.
    """

    name: str
    type_name: str
    n_messages: int
    first_s: float
    last_s: float
    rate_hz: float
    longest_gap_s: float
    n_gaps: int
    n_log_steps_back: int
    n_stamp_steps_back: int
    stamp_delay_s: tuple[float, float] | None


@dataclass(frozen=True)
class BagCheck:
    """faults: what makes the bag wrong; remarks: what to know before learning from it."""

    path: Path
    topics: tuple[TopicCheck, ...]
    faults: tuple[str, ...]
    remarks: tuple[str, ...]

    @property
    def sound(self) -> bool:
        """Whether nothing is wrong."""
        return not self.faults

    @property
    def n_messages(self) -> int:
        """Readable messages."""
        return sum(topic.n_messages for topic in self.topics)


def check_bag(path: str | Path, required: Sequence[str] = ()) -> BagCheck:
    """Read the whole bag; `required`: topics that must have messages, in any namespace."""
    reader = BagReader(path, tolerant=True, thorough=True)
    times = {name: (array("q"), array("q")) for name in reader.topics}
    stamped = {name: _has_header(topic) for name, topic in reader.topics.items()}
    faults: list[str] = []
    try:
        for message in reader.messages():
            logs, stamps = times[message.topic]
            logs.append(message.log_time_ns)
            if stamped[message.topic]:
                stamps.append(_stamp_ns(message))
    except BagError as error:
        faults.append(str(error))
    faults += [each.sentence() for each in reader.damage]
    topics = tuple(_topic(topic, *times[name]) for name, topic in sorted(reader.topics.items()))
    filled = {topic.name.rsplit("/", 1)[-1] for topic in topics if topic.n_messages}
    wanted = {name.rsplit("/", 1)[-1]: name for name in required}
    faults += [f"topic {wanted[name]} has no message" for name in wanted if name not in filled]
    remarks = _remarks(topics)
    if any(storage_name(file).endswith(".db3") for file in reader.layout.files):
        remarks.append(_NO_CHECKSUMS)
    return BagCheck(Path(path), topics, tuple(faults), tuple(remarks))


def _topic(topic: TopicInfo, log_ns: "array[int]", stamp_ns: "array[int]") -> TopicCheck:
    log_s = np.array(log_ns, dtype=np.int64) / _SECOND_NS
    steps_s: FloatArray = np.diff(np.array(log_ns, dtype=np.int64)).astype(np.float64) / _SECOND_NS
    usual_s, rate_hz = _usual(steps_s)
    gap_s = max(_GAP_FACTOR * usual_s, _SHORTEST_GAP_S)
    stamps = np.array(stamp_ns, dtype=np.int64)
    sent = stamps > 0
    delay_s = (np.array(log_ns, dtype=np.int64)[: len(stamps)] - stamps)[sent] / _SECOND_NS
    return TopicCheck(
        name=topic.name,
        type_name=topic.type_name,
        n_messages=len(log_ns),
        first_s=float(log_s.min(initial=np.inf)) if len(log_s) else 0.0,
        last_s=float(log_s.max(initial=0.0)),
        rate_hz=rate_hz,
        longest_gap_s=float(steps_s.max(initial=0.0)),
        n_gaps=int(np.count_nonzero(steps_s > gap_s)),
        n_log_steps_back=int(np.count_nonzero(steps_s < 0)),
        n_stamp_steps_back=int(np.count_nonzero(np.diff(stamps[sent]) < 0)),
        stamp_delay_s=(float(delay_s.min()), float(delay_s.max())) if len(delay_s) else None,
    )


def _usual(steps_s: FloatArray) -> tuple[float, float]:
    """Distance (s) between messages, or bursts of them, and messages per second; 0 if unknown."""
    apart = steps_s[steps_s > _BURST_S]
    if not len(apart) and steps_s.sum() <= _BURST_S:
        return 0.0, 0.0
    if not len(apart):
        usual_s = float(np.median(steps_s))
        return usual_s, 1.0 / usual_s if usual_s > 0 else 0.0
    usual_s = float(np.median(apart))
    return usual_s, int((steps_s >= 0).sum()) / len(apart) / usual_s


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
    return remarks


def _times(number: int) -> str:
    return "once" if number == 1 else f"{number} times"


def _has_header(topic: TopicInfo) -> bool:
    definition = kept_definition(topic)
    return definition.encoding == ENCODING and _begins_with_header(definition.text)


@cache
def _begins_with_header(text: str) -> bool:
    fields = (line.split("#")[0].split() for line in text.splitlines())
    first: list[str] = next((words for words in fields if len(words) >= 2), [])
    return bool(first) and first[0] in ("std_msgs/Header", "std_msgs/msg/Header", "Header")


def _stamp_ns(message: RawMessage) -> int:
    data = message.data
    if len(data) < 12:
        return 0
    little = bool(data[1] & 1)
    second = int.from_bytes(data[4:8], "little" if little else "big", signed=True)
    return second * _SECOND_NS + int.from_bytes(data[8:12], "little" if little else "big")
