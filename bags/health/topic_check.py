"""Rates, gaps and clocks of one topic, from its log times and stamps.

Clocks are compared by delay = log time - stamp. A late message has a long delay; the least delay
within a second changes only where a clock jumps or runs at another rate. (NTP filters clocks
likewise: RFC 5905, section 10.)
"""

from array import array
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from bags.messages.times import AGREEMENT_S
from bags.topic import Topic
from serd_core.arrays import FloatArray

_SECOND_NS = 1_000_000_000
#: A gap is this many times the usual distance of a topic's messages, and at least this long.
_GAP_FACTOR, _SHORTEST_GAP_S = 5.0, 0.5
#: Messages closer together are one burst, or have no stamps and were given the same log time.
_BURST_S = 1e-3
_BLOCK_S = 1.0
_FEWEST_BLOCKS = 5
_LEAST_JUMP_S = 0.5
_LEAST_DRIFT_S = 0.1
#: A trend must be that many standard deviations of the residuals.
_CLEAR = 5.0


@dataclass(frozen=True)
class TwoClocks:
    """Stamps against log times. jumps_s: forward above 0; drift_s: over span_s, ahead above 0.

    offset_s: how far the clock of the stamps is ahead; 0 where it is the same one, jumps or drifts.
    """

    jumps_s: tuple[float, ...] = ()
    drift_s: float = 0.0
    span_s: float = 0.0
    offset_s: float = 0.0


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
        clocks=two_clocks((sent_logs - logs[:1]) / _SECOND_NS, delay_s),
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


def two_clocks(log_s: FloatArray, delay_s: FloatArray) -> TwoClocks:
    """Compare the clocks by log times and delays (N,); no result for less than 5 s."""
    time_s, delay_s = _least_delays(log_s, delay_s)
    if len(time_s) < _FEWEST_BLOCKS:
        return TwoClocks()
    # The middle one of each three: without single outliers.
    time_s, delay_s = time_s[1:-1], np.median(sliding_window_view(delay_s, 3), axis=1)
    steps_s, apart_s = np.diff(delay_s), np.diff(time_s)
    unusual_s = steps_s - np.median(steps_s / apart_s) * apart_s
    jumped = np.abs(unusual_s) > _LEAST_JUMP_S
    jumps_s = np.where(jumped, unusual_s, 0.0)
    smooth_s = delay_s - np.concatenate([[0.0], np.cumsum(jumps_s)])
    drift_s = -_trend(time_s, smooth_s)
    offset_s = -float(np.median(delay_s))
    is_offset = not jumped.any() and not drift_s and abs(offset_s) > AGREEMENT_S
    return TwoClocks(
        jumps_s=tuple(float(-jump_s) for jump_s in jumps_s[jumped]),
        drift_s=drift_s,
        span_s=float(time_s[-1] - time_s[0]),
        offset_s=offset_s if is_offset else 0.0,
    )


def _least_delays(log_s: FloatArray, delay_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(log time, delay) of the least delayed message of each second that has any."""
    order = np.lexsort((delay_s, np.floor(log_s / _BLOCK_S)))
    _, first = np.unique(np.floor(log_s[order] / _BLOCK_S), return_index=True)
    return log_s[order][first], delay_s[order][first]


def _trend(time_s: FloatArray, delay_s: FloatArray) -> float:
    """Change over the whole time by a straight line; 0 where there is no clear trend."""
    slope, level = np.polyfit(time_s - time_s[0], delay_s, 1)
    rest_s = float(np.std(delay_s - level - slope * (time_s - time_s[0])))
    change_s = float(slope * (time_s[-1] - time_s[0]))
    return change_s if abs(change_s) > max(_LEAST_DRIFT_S, _CLEAR * rest_s) else 0.0
