"""Rates, gaps and clocks of one topic, from its log times and stamps."""

from array import array
from dataclasses import dataclass

import numpy as np

from bags.health.two_clocks import TwoClocks, two_clocks
from bags.topic import Topic
from serd_core.arrays import FloatArray

_SECOND_NS = 1_000_000_000
#: A gap is this many times the usual distance of a topic's messages, and at least this long.
_GAP_FACTOR, _SHORTEST_GAP_S = 5.0, 0.5
#: Messages closer together are one burst, or have no stamps and were given the same log time.
_BURST_S = 1e-3


@dataclass(frozen=True)
class TopicCheck:
    """mean_hz: from first to last; rate_hz: from the usual distance of bursts and their usual size.

    Both are None where there are too few messages.
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
    clocks: TwoClocks


def check_topic(
    topic: Topic, log_ns: "array[int]", stamp_ns: "array[int]", n_further: int = 0
) -> TopicCheck:
    """Times of one topic, in the order of the bag; stamps 0 where not set, none without headers.

    n_further: messages whose times are not given.
    """
    logs = np.array(log_ns, dtype=np.int64)
    log_s = logs / _SECOND_NS
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
        mean_hz=_mean_hz(log_s),
        rate_hz=rate_hz,
        longest_gap_s=float(steps_s.max(initial=0.0)),
        n_gaps=int(np.count_nonzero(steps_s > gap_s)),
        n_log_steps_back=int(np.count_nonzero(steps_s < 0)),
        n_stamp_steps_back=int(np.count_nonzero(np.diff(stamps[sent]) < 0)),
        stamp_delay_s=(float(delay_s.min()), float(delay_s.max())) if len(delay_s) else None,
        clocks=two_clocks((sent_logs - logs[:1]) / _SECOND_NS, delay_s),
    )


def _mean_hz(log_s: FloatArray) -> float | None:
    span_s = float(np.ptp(log_s)) if len(log_s) else 0.0
    return (len(log_s) - 1) / span_s if span_s > _BURST_S else None


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
