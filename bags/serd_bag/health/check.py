"""Checks of a whole recording: damage, counts, gaps, clocks.

The stamp of a message is that of the std_msgs/Header it begins with, or of the first element of the
array it begins with; its log time is when the recorder received it. `messages.clocks` compares the
clocks of both: offset, drift and jumps, apart from messages that a link held back.
"""

import re
from array import array
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from serd_bag.errors import BagError
from serd_bag.formats.limits import MOST_FAULTS
from serd_bag.formats.rosbag2.message_types import message_type
from serd_bag.messages.clocks import ClockDifference, FloatArray, clock_difference
from serd_bag.messages.plain import CDR_HEAD, message_stamp_ns
from serd_bag.messages.times import AGREEMENT_S
from serd_bag.quantities import counted
from serd_bag.reader import BagReader
from serd_bag.topic import ROS2MSG, Topic, nearest_topic, topics_named

_SECOND_NS = 1_000_000_000
#: A gap is this many times the usual distance of a topic's messages, and at least this long.
_GAP_FACTOR, _SHORTEST_GAP_S = 5.0, 0.5
#: Messages closer together are one burst, or have no stamps and were given the same log time.
_BURST_S = 1e-3
#: Messages whose times are kept in memory.
_MOST_COMPARED = 1_000_000
#: Characters of a definition in which its first field is sought.
_LONGEST_BEGINNING = 20_000
_HEADERS = ("std_msgs/Header", "std_msgs/msg/Header", "Header")
_NO_CHECKSUMS = (
    "a part of the bag has no checksums: changed bytes in it cannot be detected; 'serd-bag convert'"
    " adds checksums"
)


@dataclass(frozen=True)
class TopicCheck:
    """Number, rates, gaps and clocks of the messages of one topic.

    mean_hz: from first to last; rate_hz: from the usual distance of bursts and their usual size;
    both are None where there are too few messages.
    longest_gap_s: between log times; n_gaps: unusual ones.
    n_log_steps_back, n_stamp_steps_back: times the clock went backwards.
    stamp_delay_s: log time minus stamp, (least, greatest); None where there are no stamps.
    clocks: stamps compared with log times.
    """

    name: str
    type_name: str
    n_messages: int
    first_s: float
    last_s: float
    mean_hz: float | None
    rate_hz: float | None
    longest_gap_s: float
    n_gaps: int
    n_log_steps_back: int
    n_stamp_steps_back: int
    stamp_delay_s: tuple[float, float] | None
    clocks: ClockDifference


def check_topic(
    topic: Topic, log_ns: "array[int]", stamp_ns: "array[int]", n_further: int = 0
) -> TopicCheck:
    """Times of one topic, in the order of the bag; stamps 0 where not set, none without headers.

    n_further: messages whose times are not given.
    """
    logs = np.array(log_ns, dtype=np.int64)
    log_s = logs / _SECOND_NS
    span_s = float(np.ptp(log_s)) if len(log_s) else 0.0
    steps_s: FloatArray = np.diff(logs).astype(np.float64) / _SECOND_NS
    usual_s, rate_hz = _usual(steps_s)
    gap_s = max(_GAP_FACTOR * usual_s, _SHORTEST_GAP_S)
    stamps = np.array(stamp_ns, dtype=np.int64)
    sent = stamps > 0
    sent_logs = logs[: len(stamps)][sent]
    delay_s = (sent_logs - stamps[sent]) / _SECOND_NS
    return TopicCheck(
        name=topic.name,
        type_name=topic.type_name,
        n_messages=len(log_ns) + n_further,
        first_s=float(log_s.min(initial=np.inf)) if len(log_s) else 0.0,
        last_s=float(log_s.max(initial=0.0)),
        mean_hz=(len(log_s) - 1) / span_s if span_s > _BURST_S else None,
        rate_hz=rate_hz,
        longest_gap_s=float(steps_s.max(initial=0.0)),
        n_gaps=int(np.count_nonzero(steps_s > gap_s)),
        n_log_steps_back=int(np.count_nonzero(steps_s < 0)),
        n_stamp_steps_back=int(np.count_nonzero(np.diff(stamps[sent]) < 0)),
        stamp_delay_s=(float(delay_s.min()), float(delay_s.max())) if len(delay_s) else None,
        clocks=clock_difference((sent_logs - logs[:1]) / _SECOND_NS, delay_s),
    )


def _usual(steps_s: FloatArray) -> tuple[float, float | None]:
    """Distance (s) between messages, or bursts of them, and messages per second."""
    apart = steps_s[steps_s > _BURST_S]
    if not len(apart) and steps_s.sum() <= _BURST_S:
        return 0.0, None
    if not len(apart):
        usual_s = float(np.median(steps_s))
        return usual_s, 1.0 / usual_s if usual_s > 0 else None
    usual_s = float(np.median(apart))
    return usual_s, int((steps_s >= 0).sum()) / len(apart) / usual_s


@dataclass(frozen=True)
class BagCheck:
    """The result of `check_bag`.

    faults: why the bag is not sound; remarks: what to know before learning from it; n_lost:
    messages that are known to be lost.
    """

    path: Path
    topics: tuple[TopicCheck, ...]
    faults: tuple[str, ...]
    remarks: tuple[str, ...]
    n_lost: int = 0

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
    """Read the whole bag and list its faults; `required`: topics that must have messages.

        check = check_bag("drive", ["robot_pose"])
        print(check.sound, *check.faults, *check.remarks, sep="\\n")

    Raises BagError where there is no bag. A name that begins with "/" is one topic, any other a
    topic of that name in any namespace.
    """
    reader = BagReader(path, tolerant=True, thorough=True)
    times = {name: (array("q"), array("q")) for name in reader.topics}
    places = {name: _stamp_place(topic) for name, topic in reader.topics.items()}
    faults: list[str] = []
    further: Counter[str] = Counter()
    n_compared = n_untimed = 0
    try:
        for message in reader.messages():
            if n_compared == _MOST_COMPARED or message.log_time_ns >> 63:
                further[message.topic] += 1
                n_untimed += message.log_time_ns >> 63
                continue
            n_compared += 1
            logs, stamps = times[message.topic]
            logs.append(message.log_time_ns)
            place = places[message.topic]
            if place is not None:
                stamps.append(_stamp_ns(message.data, place))
    except BagError as error:
        faults.append(str(error))
    faults += [each.sentence() for each in reader.damage]
    known = sorted(reader.topics.items())
    topics = tuple(check_topic(topic, *times[name], further[name]) for name, topic in known)
    faults += _missing(topics, required)
    remarks = _remarks(topics)
    remarks += _not_compared(n_untimed, n_compared)
    if topics and not reader.has_checksums:
        remarks.append(_NO_CHECKSUMS)
    n_lost = reader.losses.n_messages
    return BagCheck(Path(path), topics, _at_most(faults), _at_most(remarks), n_lost)


def _not_compared(n_untimed: int, n_compared: int) -> Iterator[str]:
    if n_untimed:
        yield f"{n_untimed} messages have log times below 0 or after 2^63-1 ns"
    if n_compared == _MOST_COMPARED:
        yield f"rates, gaps and clocks are those of the first {n_compared} messages"


def _at_most(lines: list[str]) -> tuple[str, ...]:
    """The first lines; the last one states how many are left out."""
    if len(lines) <= MOST_FAULTS:
        return tuple(lines)
    return (*lines[: MOST_FAULTS - 1], f"{len(lines) - MOST_FAULTS + 1} more are not listed")


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
    remarks = [f"{topic.name}: {remark}" for topic in topics for remark in _remarks_on(topic)]
    # Clocks that differ by a constant; that of log times may be the one that differs.
    compared = [topic for topic in topics if topic.clocks.span_s]
    ahead_s = [_constant_s(topic.clocks) for topic in compared]
    if len(compared) > 1 and all(ahead_s) and np.ptp(ahead_s) <= AGREEMENT_S:
        how_far = _ahead(ahead_s[0])
        return [*remarks, f"all stamps are {how_far} log times: those of another or simulated time"]
    return remarks + [
        f"{topic.name}: stamps are {_ahead(offset_s)} log times: the clock of its sender is wrong"
        for topic, offset_s in zip(compared, ahead_s, strict=True)
        if offset_s
    ]


def _constant_s(clocks: ClockDifference) -> float:
    """How far stamps are ahead all the time; 0 where they agree, jump or drift."""
    is_apart = abs(clocks.offset_s) > AGREEMENT_S and not clocks.jumps and not clocks.drift
    return clocks.offset_s if is_apart else 0.0


def _remarks_on(topic: TopicCheck) -> Iterator[str]:
    if not topic.n_messages:
        yield "no message"
    if topic.n_gaps:
        yield f"{counted(topic.n_gaps, 'gap')}, the longest {topic.longest_gap_s:.2f} s"
    if topic.n_log_steps_back:
        yield f"log time steps back {_times(topic.n_log_steps_back)}"
    if topic.n_stamp_steps_back:
        yield f"stamps step back {_times(topic.n_stamp_steps_back)}"
    jumps_s = [size_s for _, size_s in topic.clocks.jumps]
    drift_s, held_s = topic.clocks.drift_s, topic.clocks.held_s
    if jumps_s:
        largest_s = max(jumps_s, key=abs)
        way = "forward" if largest_s > 0 else "back"
        often = "" if len(jumps_s) == 1 else f" {_times(len(jumps_s))}, the largest"
        yield f"stamps jump against log times{often} {way} by {abs(largest_s):.2f} s"
    if drift_s:
        way = "ahead of" if drift_s > 0 else "behind"
        yield f"stamps run {way} log times by {abs(drift_s):.2f} s in {topic.clocks.span_s:.0f} s"
    if held_s:
        often = _times(topic.clocks.n_held)
        yield f"messages were held back {often}, up to {held_s:.1f} s, as by a radio link"


def _ahead(offset_s: float) -> str:
    return f"{abs(offset_s):.2f} s {'ahead of' if offset_s > 0 else 'behind'}"


def _times(number: int) -> str:
    return "once" if number == 1 else f"{number} times"


def _stamp_place(topic: Topic) -> int | None:
    """Byte of a message at which its stamp is: that of a std_msgs/Header with which it begins, or
    with which the first element of the array begins that it begins with, as in /tf."""
    definition = topic.message_type
    if not definition.text:
        try:
            definition = message_type(definition.name)
        except BagError:
            return None
    if definition.encoding != ROS2MSG:
        return None
    own, *others = re.split(r"^=+\nMSG: (\S+)\n", definition.text[:_LONGEST_BEGINNING], flags=re.M)
    kind = _first_kind(own)
    if kind in _HEADERS:
        return CDR_HEAD
    is_array, element = kind.endswith("[]"), kind.removesuffix("[]").replace("/msg/", "/")
    texts = {
        name.replace("/msg/", "/"): text
        for name, text in zip(others[::2], others[1::2], strict=True)
    }
    name = next((each for each in texts if each in (element, f"{_package(topic)}/{element}")), None)
    return 2 * CDR_HEAD if is_array and name and _first_kind(texts[name]) in _HEADERS else None


def _package(topic: Topic) -> str:
    return topic.type_name.partition("/")[0]


def _first_kind(text: str) -> str:
    """Type of the first field of a definition."""
    fields = (line.split("#")[0].split() for line in text.splitlines())
    return next((words[0] for words in fields if len(words) >= 2), "")


def _stamp_ns(data: bytes, place: int) -> int:
    if place > CDR_HEAD and not any(data[CDR_HEAD:place]):
        return 0  # an array without elements
    try:
        return message_stamp_ns(data, place)
    except BagError:
        return 0
