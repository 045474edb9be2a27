"""Time of arrival in seconds, from an arrival counted in decision periods.

The chain of `arrival` counts decision periods of length D and, as in the thesis, dates an arrival
in the N-th to its end, N D. In truth the robot enters the goal area in the middle of that period.
With U in (0, D] the time from the beginning of the last period to the entry,

    T = (N - 1) D + U,    P(T <= t) = sum_n P(N = n) P(U <= t - (n - 1) D)

where U is taken as independent of N. If the next entry is exchangeable with the n that were seen in
demonstrations, it falls into each of the n + 1 gaps that these leave in (0, D] with probability
1 / (n + 1), whatever their distribution (Hill, J. Am. Stat. Assoc. 63, 1968). Within a gap it is
taken as uniform. The thesis is the case U = D.
"""

from dataclasses import dataclass, replace
from math import ceil

import numpy as np
from numpy.typing import ArrayLike

from serd_core.arrays import FloatArray, float_array, require_each
from serd_core.arrival.chain import ArrivalTimes
from serd_core.errors import SerdError

# A time that was meant to be a step of the law may miss it by rounding.
SAME_TIME_S = 1e-9
#: Steps of a period by which a law that climbs evenly within gaps is written.
N_STEPS = 40


def steps_within(time_s: float, step_s: float) -> int:
    """Fewest steps that last as long as a time."""
    return ceil(time_s / step_s - SAME_TIME_S)


@dataclass(frozen=True, eq=False)
class ArrivalLaw:
    """A step function: cdf (n,) from each of times_s (n,) up to the next, 0 before the first.

    arrival_probability: of ever arriving, which cdf approaches. cdf_draws: see `ArrivalTimes`.
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


def law_in_seconds(
    arrival: ArrivalTimes, *, period_s: float, entry_times_s: ArrayLike = ()
) -> ArrivalLaw:
    """The law of the time of arrival in seconds.

    entry_times_s: times within the last period at which demonstrations entered the goal area; none
    for the thesis's end of the period.
    """
    _require_period(period_s)
    given = float_array("entry_times_s", entry_times_s, (None,))
    inside = (given > 0) & (given <= period_s + SAME_TIME_S)
    rule = f"be above 0 and at most period_s = {period_s}"
    fix = "measure from the beginning of the last decision period"
    require_each("entry_times_s", given, inside, rule, fix)
    begun = np.arange(len(arrival.cdf) - 1)
    # Within period n the CDF climbs from F(n-1) to F(n), as that of the entry does.
    within_s, share = _entry_law(np.minimum(given, period_s), period_s)

    def climbing(cdf: FloatArray) -> FloatArray:
        steps = cdf[..., :-1, None] + np.diff(cdf)[..., None] * share
        return np.concatenate([cdf[..., :1], steps.reshape(*cdf.shape[:-1], -1)], axis=-1)

    times_s = period_s * begun[:, None] + within_s[None, :]
    return ArrivalLaw(
        times_s=np.concatenate([[0.0], times_s.ravel()]),
        cdf=climbing(arrival.cdf),
        arrival_probability=arrival.arrival_probability,
        cdf_draws=None if arrival.cdf_draws is None else climbing(arrival.cdf_draws),
    )


def _entry_law(entry_s: FloatArray, period_s: float) -> tuple[FloatArray, FloatArray]:
    """Times within a period, and P(U <= time) there; the end of the period alone without entries.

    Of equal entries the gaps between them have no width, so the law jumps there.
    """
    if not len(entry_s):
        return np.array([period_s]), np.ones(1)
    ends_s = np.concatenate([[0.0], np.sort(entry_s), [period_s]])
    even_s = period_s * np.arange(1, N_STEPS + 1) / N_STEPS
    times_s = np.unique(np.concatenate([even_s, entry_s]))
    gap = np.searchsorted(ends_s[1:-1], times_s, side="right")
    width_s = ends_s[gap + 1] - ends_s[gap]
    part = np.divide(times_s - ends_s[gap], width_s, out=np.ones_like(times_s), where=width_s > 0)
    return times_s, (gap + part) / (len(entry_s) + 1)


def largest_gap(law: ArrivalLaw, arrival_times_s: ArrayLike) -> float:
    """Kolmogorov-Smirnov distance of a law and measured times, inf where it did not arrive.

    The largest difference of the two step functions up to the law's last step, looked at on both
    sides of every step.
    """
    measured = np.sort(np.asarray(arrival_times_s, dtype=np.float64))
    if not measured.size or np.isnan(measured).any():
        raise SerdError(
            f"arrival_times_s must hold at least one time and no NaN, got {measured.tolist()}"
            "; use inf for an episode that did not arrive"
        )
    steps = np.unique(np.concatenate([law.times_s, measured[measured <= law.times_s[-1]]]))
    after = np.searchsorted(measured, steps + SAME_TIME_S, side="right") / len(measured)
    before = np.searchsorted(measured, steps - SAME_TIME_S, side="right") / len(measured)
    after_gap = np.abs(law.probability_by(steps) - after)
    before_gap = np.abs(law.probability_by(steps - 2 * SAME_TIME_S) - before)
    return float(np.maximum(after_gap, before_gap).max())


def entry_times_s(arrival_times_s: ArrayLike, period_s: float) -> FloatArray:
    """(N,) time of each measured arrival since the beginning of its decision period, in (0, D].

    arrival_times_s: (N,) since the start of the episode, which begins a period.
    """
    _require_period(period_s)
    time_s = float_array("arrival_times_s", arrival_times_s, (None,))
    fix = "leave out episodes that began at the goal, they entered it in no period"
    require_each("arrival_times_s", time_s, time_s > 0, "be above 0", fix)
    whole = np.ceil(time_s / period_s - SAME_TIME_S) - 1.0
    return np.minimum(time_s - period_s * np.maximum(whole, 0.0), period_s)


def _require_period(period_s: float) -> None:
    if not 0 < period_s < np.inf:
        raise SerdError(
            f"period_s must be above 0 and finite, got {period_s}; use the decision period"
        )
