"""The time of a message: what the recorder writes, and by which a reader places it.

Log time is when the recorder received the message, publish time when it was sent. A message with a
header is placed by its stamp where the clock of its topic's stamps agrees with another clock, that
of the log times or of another topic; any other message is placed by its log time. Messages that a
link held back are late, and their clock is right.
"""

import numpy as np
from numpy.typing import NDArray

from serd_bag.messages.clocks import FloatArray, clock_difference

_SECOND_NS = 1_000_000_000
#: A stamp that falls back by more (ns) belongs to another session.
RESTART_NS = _SECOND_NS
#: Clocks agree when they differ by at most this (s) most of the time.
AGREEMENT_S = 1.0
#: And this share of the stamps is not ahead of the receipt nor too old.
_SHARE = 0.75
#: A stamp that falls back may be older than its receipt by this time (s): the message was late.
_LATEST_S = 10.0
#: A stamp that is further ahead of /clock is of another clock.
_SIMULATED_LEAD_NS = 10 * _SECOND_NS


class RecordingClock:
    """Log and publish times of messages in the order in which they come, all on one clock.

    simulated: that of /clock. Log and publish time are then the stamp, or without one, or with one
    of another clock, the newest time of /clock and stamps, so that a world that runs at any rate
    plays back in its own time. Otherwise the clock is that of the recorder's machine.
    now_ns: the newest log time.
    """

    def __init__(self, *, simulated: bool) -> None:
        self.simulated = simulated
        self.now_ns = 0
        self._clock_ns = 0

    def times_ns(
        self, stamp_ns: int, received_ns: int, sent_ns: int, *, is_clock: bool = False
    ) -> tuple[int, int]:
        """(log time, publish time) of the next message.

        stamp_ns: of its header, at most 0 for none; sent_ns: by the middleware of the publisher,
        at most 0 where it is not known; is_clock: whether it came on /clock.
        """
        if not self.simulated:
            self.now_ns = received_ns
            published = (each for each in (sent_ns, stamp_ns) if each > 0)
            return received_ns, next(published, received_ns)
        is_far_ahead = 0 < self._clock_ns < stamp_ns - _SIMULATED_LEAD_NS
        if is_clock:  # it may fall back, because the world was started again
            self.now_ns = self._clock_ns = max(stamp_ns, 0)
        elif stamp_ns > 0 and not is_far_ahead:
            self.now_ns = max(self.now_ns, stamp_ns)
            return stamp_ns, stamp_ns
        return self.now_ns, self.now_ns


class TimesOnClock:
    """Another clock as a function of log times, from (T,) log times and times of that clock."""

    def __init__(self, log_s: FloatArray, time_s: FloatArray) -> None:
        order = np.argsort(log_s, kind="stable")
        self._log_s, self._time_s = log_s[order], time_s[order]

    def of(self, log_s: FloatArray) -> FloatArray:
        """(N,) times of the clock when messages were received, at any rate between the two."""
        if not len(self._log_s):
            return log_s
        return np.asarray(np.interp(log_s, self._log_s, self._time_s))


def agrees(clock_s: FloatArray, stamp_s: FloatArray) -> bool:
    """Whether stamps (N,), NaN or 0 where none is set, are of the clock that shows clock_s (N,)
    when the messages are received; true where none is set."""
    is_set = stamp_s > 0
    delay_s = clock_s[is_set] - stamp_s[is_set]
    if not len(delay_s):
        return True
    ahead_s = clock_difference(clock_s[is_set], delay_s).ahead_s(clock_s[is_set])
    usual_s = abs(float(np.median(ahead_s)))
    possible = _is_possible(clock_s[is_set], stamp_s[is_set])
    return usual_s <= AGREEMENT_S and float(possible.mean()) >= _SHARE


def placed_s(clock_s: FloatArray, stamp_s: FloatArray) -> FloatArray:
    """(N,) times by which messages of one topic are placed; arguments as of `agrees`.

    The stamp, where the topic's stamps agree with the clock and this one is neither ahead of it nor
    so old that it must be wrong; else the time of receipt.
    """
    if not agrees(clock_s, stamp_s):
        return clock_s
    return np.where(_is_possible(clock_s, stamp_s), stamp_s, clock_s)


def falls_back_s(time_s: FloatArray) -> FloatArray:
    """(N,) how far each time is behind the latest one before it."""
    return np.maximum.accumulate(time_s) - time_s


def _is_possible(clock_s: FloatArray, stamp_s: FloatArray) -> NDArray[np.bool_]:
    """Whether stamps are not ahead of the receipt, nor too old: those of messages that a link held
    back are old, and follow each other as they were sent."""
    delay_s = clock_s - stamp_s
    is_not_ahead = (delay_s >= -AGREEMENT_S) & (stamp_s > 0)
    first_s = clock_s.min(initial=np.inf) - _LATEST_S
    sent_s = np.where(is_not_ahead & (stamp_s > first_s), stamp_s, first_s)
    in_order = np.maximum.accumulate(sent_s) <= stamp_s + AGREEMENT_S
    return np.asarray(is_not_ahead & ((delay_s <= _LATEST_S) | in_order))
