"""Checks of a whole recording: damage, counts, gaps, clocks.

The log time of a message is when the recorder received it. `messages.clocks` compares it with the
stamps of each sender (`messages.stamps`): offset, drift and jumps of the sender's clock, apart from
messages that a link held back.
"""

from array import array
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from serd_bag.errors import BagError
from serd_bag.formats.limits import MOST_FAULTS
from serd_bag.messages.clocks import ClockDifference, FloatArray, clock_difference
from serd_bag.messages.stamps import StampFinder
from serd_bag.messages.times import AGREEMENT_S
from serd_bag.quantities import counted
from serd_bag.reader import BagReader
from serd_bag.topic import Topic, nearest_topic, topics_named

_SECOND_NS = 1_000_000_000
#: A gap is this many times the usual distance of a topic's messages, and at least this long.
_GAP_FACTOR, _SHORTEST_GAP_S = 5.0, 0.5
#: Messages closer together are one burst, or have no stamps and were given the same log time.
_BURST_S = 1e-3
#: Messages, and stamps, whose times are kept in memory.
_MOST_COMPARED = 1_000_000
#: Senders of a topic that are told apart, and of those in one sentence.
_MOST_SENDERS, _MOST_NAMED = 1_000, 5
#: Of a sender whose clock is compared.
_FEWEST_STAMPS = 5
#: Wrong clocks that differ by less (s) may be one.
_ONE_CLOCK_S = 0.1
_NO_CHECKSUMS = (
    "a part of the bag has no checksums: changed bytes in it cannot be detected; 'serd-bag convert'"
    " adds checksums"
)


@dataclass(frozen=True)
class TopicCheck:
    """Number, rates, gaps and clocks of the messages of one topic.

    mean_hz: from first to last, None where there are too few messages.
    longest_gap_s: between log times; n_gaps: unusual ones.
    n_log_steps_back, n_stamp_steps_back: times the clock went backwards.
    stamp_delay_s: log time minus stamp, (least, greatest); None where there are no stamps.
    clocks: of each sender with five stamps or more, these compared with log times.
    """

    name: str
    type_name: str
    n_messages: int
    first_s: float
    last_s: float
    mean_hz: float | None
    longest_gap_s: float
    n_gaps: int
    n_log_steps_back: int
    n_stamp_steps_back: int
    stamp_delay_s: tuple[float, float] | None
    clocks: dict[str, ClockDifference]


@dataclass
class TopicTimes:
    """Log times (ns) of messages of a topic in the order of the bag, and log time and stamp of what
    each sender has sent, but for stamps that are not set."""

    log_ns: "array[int]" = field(default_factory=lambda: array("q"))
    sent_ns: dict[str, tuple["array[int]", "array[int]"]] = field(default_factory=dict)

    def add_stamp(self, sender: str, log_ns: int, stamp_ns: int) -> None:
        """Add a stamp of a sender; those beyond the first thousand are not told apart."""
        times = self.sent_ns.get(sender)
        if times is None:
            sender = sender if len(self.sent_ns) < _MOST_SENDERS else ""
            times = self.sent_ns.setdefault(sender, (array("q"), array("q")))
        times[0].append(log_ns)
        times[1].append(stamp_ns)


def check_topic(topic: Topic, times: TopicTimes, n_further: int = 0) -> TopicCheck:
    """Check the times of one topic; n_further: messages whose times are not given."""
    logs = np.array(times.log_ns, dtype=np.int64)
    log_s = logs / _SECOND_NS
    span_s = float(np.ptp(log_s)) if len(log_s) else 0.0
    steps_s: FloatArray = np.diff(logs).astype(np.float64) / _SECOND_NS
    apart_s = steps_s[steps_s > _BURST_S]
    usual_s = float(np.median(apart_s)) if len(apart_s) else 0.0
    gap_s = max(_GAP_FACTOR * usual_s, _SHORTEST_GAP_S)
    sent = {name: np.array(each, dtype=np.int64) for name, each in sorted(times.sent_ns.items())}
    delays_s = {name: (log - stamp) / _SECOND_NS for name, (log, stamp) in sent.items()}
    delays = np.concatenate([log_s[:0], *delays_s.values()])
    return TopicCheck(
        name=topic.name,
        type_name=topic.type_name,
        n_messages=len(logs) + n_further,
        first_s=float(log_s.min(initial=np.inf)) if len(log_s) else 0.0,
        last_s=float(log_s.max(initial=0.0)),
        mean_hz=(len(log_s) - 1) / span_s if span_s > _BURST_S else None,
        longest_gap_s=float(steps_s.max(initial=0.0)),
        n_gaps=int(np.count_nonzero(steps_s > gap_s)),
        n_log_steps_back=int(np.count_nonzero(steps_s < 0)),
        n_stamp_steps_back=sum(int((np.diff(stamp) < 0).sum()) for _, stamp in sent.values()),
        stamp_delay_s=(float(delays.min()), float(delays.max())) if len(delays) else None,
        clocks={
            name: clock_difference(log / _SECOND_NS, delays_s[name])
            for name, (log, _) in sent.items()
            if len(log) >= _FEWEST_STAMPS
        },
    )


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


def check_bag(
    path: str | Path, required: Sequence[str] = (), *, most_compared: int = _MOST_COMPARED
) -> BagCheck:
    """Read the whole bag and list its faults.

    required: topics that must have messages; most_compared: messages, and stamps, whose times are
    kept in memory.

        check = check_bag("drive", ["robot_pose"])
        print(check.sound, *check.faults, *check.remarks, sep="\\n")

    Raises BagError where there is no bag. A name that begins with "/" is one topic, any other a
    topic of that name in any namespace.
    """
    reader = BagReader(path, tolerant=True, thorough=True)
    times = {name: TopicTimes() for name in reader.topics}
    finders = {(name, each.type_name): StampFinder(each) for name, each in reader.topics.items()}
    faults: list[str] = []
    further: Counter[str] = Counter()
    n_compared = n_stamps = n_untimed = 0
    try:
        for topic, type_name, data, log_ns, _ in reader.messages():
            if max(n_compared, n_stamps) >= most_compared or log_ns >> 63:
                further[topic] += 1
                n_untimed += log_ns >> 63
                continue
            n_compared += 1
            times[topic].log_ns.append(log_ns)
            finder = finders.get((topic, type_name))  # a topic may have other types
            for _, stamp_ns, sender in finder(data) if finder else ():
                if stamp_ns > 0:
                    n_stamps += 1
                    times[topic].add_stamp(sender, log_ns, stamp_ns)
    except BagError as error:
        faults.append(str(error))
    faults += [each.sentence() for each in reader.damage]
    known = sorted(reader.topics.items())
    topics = tuple(check_topic(topic, times[name], further[name]) for name, topic in known)
    faults += _missing(topics, required)
    remarks = [*_remarks(topics), *_not_compared(n_untimed, n_compared, further.total())]
    if topics and not reader.has_checksums:
        remarks.append(_NO_CHECKSUMS)
    n_lost = reader.losses.n_messages
    return BagCheck(Path(path), topics, _at_most(faults), _at_most(remarks), n_lost)


def _not_compared(n_untimed: int, n_compared: int, n_further: int) -> Iterator[str]:
    if n_untimed:
        yield f"{n_untimed} messages have log times below 0 or after 2^63-1 ns"
    if n_further > n_untimed:
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
    wrong = wrong_clocks(topics)
    by_clock: dict[tuple[str, str], list[str]] = {}
    compared = _compared(topics)
    if compared and not wrong and (ahead_s := _constant_s(next(iter(compared.values())))):
        how_far = _ahead(ahead_s)
        return [*remarks, f"all stamps are {how_far} log times: those of another or simulated time"]
    for (name, sender), clocks in wrong.items():
        levels = f"{round(clocks.offset_s / _ONE_CLOCK_S)}"
        by_clock.setdefault((name, levels if _constant_s(clocks) else sender), []).append(sender)
    several = {topic.name for topic in topics if len(topic.clocks) > 1}
    for (name, _), senders in by_clock.items():
        more = f" and {len(senders) - _MOST_NAMED} more" if len(senders) > _MOST_NAMED else ""
        of_whom = f" ({', '.join(senders[:_MOST_NAMED])}{more})" if name in several else ""
        about = _remark_on_clock(wrong[name, senders[0]])
        remarks.append(f"{name}{of_whom}: {about}")
    return remarks


def wrong_clocks(topics: Sequence[TopicCheck]) -> dict[tuple[str, str], ClockDifference]:
    """The clocks that jump, drift or are ahead or behind, by topic and sender.

    None where all are ahead by the same time: that of log times may be the wrong one.
    """
    compared = _compared(topics)
    ahead_s = [_constant_s(clocks) for clocks in compared.values()]
    if len(compared) > 1 and all(ahead_s) and np.ptp(ahead_s) <= AGREEMENT_S:
        return {}
    return {
        key: each for key, each in compared.items() if each.jumps or each.drift or _constant_s(each)
    }


def _compared(topics: Sequence[TopicCheck]) -> dict[tuple[str, str], ClockDifference]:
    """The clocks that can be compared: a few old stamps may be those of messages that were kept,
    as maps are, but none can be ahead."""
    return {
        (topic.name, sender): clocks
        for topic in topics
        for sender, clocks in topic.clocks.items()
        if clocks.span_s or clocks.offset_s > -AGREEMENT_S
    }


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
    held = max(topic.clocks.values(), key=lambda each: each.held_s, default=ClockDifference())
    if held.held_s:
        often = _times(held.n_held)
        yield f"messages were held back {often}, up to {held.held_s:.1f} s, as by a radio link"


def _remark_on_clock(clocks: ClockDifference) -> str:
    parts = []
    jumps_s = [size_s for _, size_s in clocks.jumps]
    if jumps_s:
        largest_s = max(jumps_s, key=abs)
        way = "forward" if largest_s > 0 else "back"
        often = "" if len(jumps_s) == 1 else f" {_times(len(jumps_s))}, the largest"
        parts.append(f"jump against log times{often} {way} by {abs(largest_s):.2f} s")
    if clocks.drift:
        way = "ahead of" if clocks.drift > 0 else "behind"
        drift_s = abs(clocks.drift_s)
        parts.append(f"run {way} log times by {drift_s:.2f} s in {clocks.span_s:.0f} s")
    if abs(clocks.offset_s) > AGREEMENT_S and not parts:
        parts.append(f"are {_ahead(clocks.offset_s)} log times: the clock of its sender is wrong")
    return f"stamps {' and '.join(parts)}"


def _ahead(offset_s: float) -> str:
    return f"{abs(offset_s):.2f} s {'ahead of' if offset_s > 0 else 'behind'}"


def _times(number: int) -> str:
    return "once" if number == 1 else f"{number} times"
