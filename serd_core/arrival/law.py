"""Time of arrival as a step function of seconds."""

from dataclasses import dataclass, replace
from math import ceil

import numpy as np
from numpy.typing import ArrayLike

from serd_core.arrays import FloatArray

# A time that was meant to be a step of the law may miss it by rounding.
SAME_TIME_S = 1e-9


def steps_within(time_s: float, step_s: float) -> int:
    """Fewest steps that last as long as a time."""
    return ceil(time_s / step_s - SAME_TIME_S)


@dataclass(frozen=True, eq=False)
class ArrivalLaw:
    """A step function: cdf (n,) from each of times_s (n,) up to the next, 0 before the first.

    arrival_probability: of ever arriving, which cdf approaches. cdf_draws: (d, n) of each draw of a
    posterior, of which cdf is the mean; None for one model.
    """

    times_s: FloatArray
    cdf: FloatArray
    arrival_probability: float
    cdf_draws: FloatArray | None = None

    def probability_by(self, time_s: ArrayLike) -> FloatArray:
        """Probability of having arrived by a time, or by each of several."""
        asked = np.asarray(time_s, dtype=np.float64) + SAME_TIME_S
        index = np.searchsorted(self.times_s, asked, side="right")
        return np.asarray(np.concatenate([[0.0], self.cdf])[index])

    def quantile_s(self, share: float) -> float | None:
        """First time by which a share of all robots has arrived, None where that never happens."""
        reached = np.flatnonzero(self.cdf >= share - 1e-12)
        return float(self.times_s[reached[0]]) if reached.size else None

    def delayed(self, delay_s: float) -> "ArrivalLaw":
        """The same law counted from `delay_s` before: remaining time as time since the start."""
        return replace(self, times_s=self.times_s + delay_s)
