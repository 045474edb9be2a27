"""Comparison of the clock of a topic's stamps with that of its log times.

delay = log time - stamp. A late message has a long delay; the least delay
within a second changes only where a clock jumps or runs at another rate. (NTP filters clocks
likewise: RFC 5905, section 10.)
"""

from dataclasses import dataclass

import numpy as np

from bags.messages.times import AGREEMENT_S
from serd_core.arrays import FloatArray

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


def two_clocks(log_s: FloatArray, delay_s: FloatArray) -> TwoClocks:
    """Compare the clocks by log times and delays (N,); no result for less than 5 s."""
    time_s, delay_s = _least_delays(log_s, delay_s)
    if len(time_s) < _FEWEST_BLOCKS:
        return TwoClocks()
    time_s, delay_s = time_s[1:-1], _without_single_outliers(delay_s)
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


def _without_single_outliers(values: FloatArray) -> FloatArray:
    """The middle one of each three, shape (N - 2,)."""
    middle: FloatArray = np.median(np.stack([values[:-2], values[1:-1], values[2:]]), axis=0)
    return middle


def _trend(time_s: FloatArray, delay_s: FloatArray) -> float:
    """Change over the whole time by a straight line; 0 where there is no clear trend."""
    slope, level = np.polyfit(time_s - time_s[0], delay_s, 1)
    rest_s = float(np.std(delay_s - level - slope * (time_s - time_s[0])))
    change_s = float(slope * (time_s[-1] - time_s[0]))
    return change_s if abs(change_s) > max(_LEAST_DRIFT_S, _CLEAR * rest_s) else 0.0
