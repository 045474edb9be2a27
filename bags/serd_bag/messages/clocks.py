"""How a sender's clock differs from that of the log times: offset, drift and jumps.

A message waits before it is received, so its delay d = log time - stamp is at least what the clocks
differ by: d >= l(t), the lower envelope, a line where clocks run at constant rates. Among all lines
below the delays the one that is nearest to them is an edge of their convex hull, that at the mean
time (Moon, Skelly and Towsley, INFOCOM 1999). The least delay within each second stands for that
second, the median of three for their middle one, so that single wrong stamps do not count.

A link that stalls or is too slow holds messages back: delays grow, by no more than the time that
passes, and return to the envelope. A clock that jumps leaves it for good, or its stamps leap.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
_BLOCK_S = 1.0
_FEWEST_BLOCKS = 5
_LEAST_JUMP_S, _LEAST_DRIFT_S = 0.5, 0.1
#: A line fits where it is this share of its rise from the least delay of its first and last third.
_FITS = 0.1
#: Share of the stamps of a short recording that may be ahead of the envelope.
_AHEAD = 0.25


@dataclass(frozen=True)
class ClockDifference:
    """How far stamps are ahead of log times, without the time that messages were on the way.

    offset_s: at the first message; drift: seconds per second, ahead above 0; jumps: (log time
    before which a jump is, seconds, forward above 0); span_s: from the first to the last second
    that was compared, 0 where there are fewer than five, whose offset alone is estimated. held_s:
    the longest time that a message was held back, n_held: how often messages were, by half a second
    or more, before they caught up.
    """

    offset_s: float = 0.0
    drift: float = 0.0
    jumps: tuple[tuple[float, float], ...] = ()
    span_s: float = 0.0
    held_s: float = 0.0
    n_held: int = 0
    first_s: float = field(default=0.0, repr=False)

    @property
    def drift_s(self) -> float:
        """Seconds gained in the whole time."""
        return self.drift * self.span_s

    def ahead_s(self, log_s: FloatArray) -> FloatArray:
        """(N,) how far stamps are ahead at log times (N,)."""
        ahead_s = self.offset_s + self.drift * (log_s - self.first_s)
        for before_s, size_s in self.jumps:
            ahead_s = ahead_s + np.where(log_s >= before_s, size_s, 0.0)
        return np.asarray(ahead_s)


def clock_difference(log_s: FloatArray, delay_s: FloatArray) -> ClockDifference:
    """Compare two clocks by log times and delays (N,) of messages, in any order."""
    order = np.argsort(log_s, kind="stable")
    log_s, delay_s = log_s[order], delay_s[order]
    if not len(log_s):
        return ClockDifference()
    first_s = float(log_s[0])
    delay_s[1:-1] = _medians(delay_s)
    time_s, least_s = _least_delays(log_s - first_s, delay_s)
    if len(time_s) < _FEWEST_BLOCKS:
        level_s = float(np.quantile(delay_s, _AHEAD, method="lower"))
        return ClockDifference(-level_s, first_s=first_s)
    time_s, least_s = time_s[1:-1], _medians(least_s)
    leaps_s = _leaps(log_s - first_s, delay_s)
    usual = float(np.median(np.diff(least_s) / np.diff(time_s)))
    jumps_s = min(
        (_jumps(time_s, least_s, leaps_s, slope) for slope in (0.0, usual)), key=np.count_nonzero
    )
    smooth_s = least_s - np.cumsum(jumps_s)
    level_s, slope = _envelope(time_s, smooth_s)
    late_s = smooth_s - level_s - slope * time_s
    is_late = np.concatenate([[False], late_s > _LEAST_JUMP_S, [False]])
    jumped = np.flatnonzero(jumps_s)
    return ClockDifference(
        offset_s=-level_s,
        drift=-slope,
        jumps=tuple(
            (first_s + _place(time_s, leaps_s, int(row)), float(-jumps_s[row])) for row in jumped
        ),
        span_s=float(time_s[-1] - time_s[0]),
        held_s=max(0.0, float(late_s.max())) if is_late.any() else 0.0,
        n_held=int(np.count_nonzero(np.diff(is_late.astype(int)) < 0)),
        first_s=first_s,
    )


def _medians(delay_s: FloatArray) -> FloatArray:
    """(N - 2,) medians of each three that follow each other."""
    if len(delay_s) < 3:
        return delay_s[1:-1]
    return np.asarray(np.median(sliding_window_view(delay_s, 3), axis=1))


def _least_delays(log_s: FloatArray, delay_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(log time, delay) of the least delayed message of each second that has any."""
    order = np.lexsort((delay_s, np.floor(log_s / _BLOCK_S)))
    _, first = np.unique(np.floor(log_s[order] / _BLOCK_S), return_index=True)
    return log_s[order][first], delay_s[order][first]


def _leaps(log_s: FloatArray, delay_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(log times, sizes) where stamps step back, or forward by more than the time that passes."""
    passed_s, later_s = np.diff(log_s), np.diff(delay_s)
    leapt = (passed_s - later_s < -_LEAST_JUMP_S) | (later_s < -_LEAST_JUMP_S)
    return log_s[1:][leapt], later_s[leapt]


def _jumps(
    time_s: FloatArray, least_s: FloatArray, leaps_s: tuple[FloatArray, FloatArray], slope: float
) -> FloatArray:
    """(N,) by how much delays change for good from one second to the next, but for a slope."""
    level_s = least_s - slope * (time_s - time_s[0])
    jumps_s = np.zeros(len(level_s))
    floor_s, row = level_s[0], 1
    while row < len(level_s):
        now_s = level_s[row]
        change_s = now_s - level_s[row - 1]
        leapt_s = _leapt(time_s, leaps_s, row)
        if change_s < -_LEAST_JUMP_S and now_s < floor_s - _LEAST_JUMP_S:
            jumps_s[row], floor_s = (change_s if leapt_s < 0 else 0.0), now_s
        elif change_s > _LEAST_JUMP_S and leapt_s > _LEAST_JUMP_S:
            jumps_s[row], floor_s = change_s, now_s
        elif change_s > _LEAST_JUMP_S:  # held back until delays are as they were, or to the end
            back = np.flatnonzero(level_s[row:] <= floor_s + _LEAST_JUMP_S)
            row += int(back[0]) if len(back) else len(level_s)
        else:
            floor_s = min(floor_s, now_s)
        row += 1
    return jumps_s


def _near(time_s: FloatArray, leaps_s: tuple[FloatArray, FloatArray], row: int) -> FloatArray:
    """Numbers of the leaps that may be the change before a second."""
    first, last = np.searchsorted(
        leaps_s[0], [time_s[row - 1] - 2 * _BLOCK_S, time_s[row] + _BLOCK_S]
    )
    return np.arange(first, last)


def _leapt(time_s: FloatArray, leaps_s: tuple[FloatArray, FloatArray], row: int) -> float:
    """By how much delays leap there in all; single wrong stamps leap there and back."""
    return float(leaps_s[1][_near(time_s, leaps_s, row)].sum())


def _place(time_s: FloatArray, leaps_s: tuple[FloatArray, FloatArray], row: int) -> float:
    """Log time from which a jump counts: that of its largest leap, else that of its second."""
    near = _near(time_s, leaps_s, row)
    if not len(near):
        return float(time_s[row])
    return float(leaps_s[0][near[np.argmax(np.abs(leaps_s[1][near]))]])


def _envelope(time_s: FloatArray, delay_s: FloatArray) -> tuple[float, float]:
    """Level at time 0 and slope of the lower envelope; slope 0 where there is no clear drift."""
    hull: list[int] = []
    for row in range(len(time_s)):
        while len(hull) > 1 and _turns(time_s, delay_s, hull[-2], hull[-1], row):
            hull.pop()
        hull.append(row)
    edge = int(np.searchsorted(time_s[hull[1:-1]], time_s.mean()))
    first, last = hull[edge], hull[edge + 1]
    slope = float((delay_s[last] - delay_s[first]) / (time_s[last] - time_s[first]))
    level_s = float(delay_s[first] - slope * time_s[first])
    rise_s = abs(slope) * float(time_s[-1] - time_s[0])
    thirds = np.array_split(delay_s - level_s - slope * time_s, 3)
    misfit_s = max(float(third.min()) for third in (thirds[0], thirds[2]))
    if rise_s > _LEAST_DRIFT_S and misfit_s <= _FITS * rise_s:
        return level_s, slope
    return float(np.quantile(delay_s, _AHEAD / 2, method="lower")), 0.0


def _turns(time_s: FloatArray, delay_s: FloatArray, one: int, two: int, three: int) -> bool:
    """Whether the second of three points is not below the line between the others."""
    run_s, rise_s = time_s[three] - time_s[one], delay_s[three] - delay_s[one]
    return bool((delay_s[two] - delay_s[one]) * run_s >= rise_s * (time_s[two] - time_s[one]))
