"""Predicted arrival to std_msgs/Float64MultiArray: a row of times, a row of probabilities.

Row 0: times (s) on the clock of the observations, the first one being when the prediction was
made; row 1: predicted probability of having arrived by then, given no arrival so far. Steps of less
than a thousandth are left out. Nothing with a header and named columns is among the messages that
tools plot.
"""

import array

import numpy as np
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout

from serd_core.arrival.law import ArrivalLaw

_SMALLEST_STEP = 1e-3


def to_arrival_message(law: ArrivalLaw, now_s: float) -> Float64MultiArray:
    """The law of the remaining time as seen at `now_s`."""
    kept = _distinct_steps(law)
    size = len(kept)
    layout = MultiArrayLayout(
        dim=[
            MultiArrayDimension(label="time_s, probability", size=2, stride=2 * size),
            MultiArrayDimension(label="step", size=size, stride=size),
        ],
        data_offset=0,
    )
    rows = np.concatenate([law.times_s[kept] + now_s, law.cdf[kept]])
    return Float64MultiArray(layout=layout, data=array.array("d", rows.tobytes()))


def _distinct_steps(law: ArrivalLaw) -> list[int]:
    kept = [0]
    for step in range(1, len(law.cdf)):
        if law.cdf[step] - law.cdf[kept[-1]] >= _SMALLEST_STEP:
            kept.append(step)
    return kept
