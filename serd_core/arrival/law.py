"""A law of arrival as a step function of seconds, and how well it agrees with measured times.

All episodes are cut off at the same horizon, so the share that arrived by time t estimates F(t)
without bias. Bands are *pointwise*: the whole curve is covered with less than their probability.
Two curves measured in one world differ by chance: those of 20 and of 40 drives by .2 in the median.
So a gap is stated with its probability by chance, and a test with the error that it would find.
"""

from dataclasses import dataclass, replace
from math import ceil

import numpy as np
import scipy  # loads special at its first use
from numpy.typing import ArrayLike

from serd_core.arrays import FloatArray, IntArray
from serd_core.checks import shown
from serd_core.display import Record
from serd_core.errors import SerdError

# A time that was meant to be a step of the law may miss it by rounding.
SAME_TIME_S = 1e-9


def steps_within(time_s: float, step_s: float) -> int:
    """Fewest steps that last as long as a time."""
    return ceil(time_s / step_s - SAME_TIME_S)


@dataclass(frozen=True, eq=False, repr=False)
class ArrivalLaw(Record):
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


@dataclass(frozen=True, eq=False, repr=False)
class EmpiricalArrival(Record):
    """Share of episodes that arrived, as a step function with a band.

    times_s: (n,) 0, times of arrival, the horizon; cdf, lower, upper: (n,) from each to the next.
    """

    times_s: FloatArray
    cdf: FloatArray
    lower: FloatArray
    upper: FloatArray
    n_episodes: int
    n_arrived: int


def empirical_arrival_cdf(
    times_s: ArrayLike, timed_out: ArrayLike, horizon_s: float, coverage: float = 0.95
) -> EmpiricalArrival:
    """Empirical CDF with exact (Clopper-Pearson) pointwise confidence bands.

    times_s: (N,) time of arrival of each episode (ignored where timed out).
    timed_out: (N,) episodes that did not arrive; later than the horizon counts as such, too.
    """
    late = np.asarray(timed_out, dtype=np.bool_)
    times = np.where(late, np.inf, np.asarray(times_s, dtype=np.float64))
    if not len(late) or np.any(np.isnan(times) | (times < 0)):
        raise SerdError(
            "times_s must hold at least one episode, and no NaN or negative time of one that"
            f" arrived, got {shown(times_s)}; use timed_out where none is known"
        )
    arrived = np.sort(times[times <= horizon_s])
    steps = np.unique(np.concatenate([[0.0], arrived, [float(horizon_s)]]))
    counts = np.searchsorted(arrived, steps, side="right")
    lower, upper = clopper_pearson(counts, len(late), coverage)
    return EmpiricalArrival(
        times_s=steps,
        cdf=counts / len(late),
        lower=lower,
        upper=upper,
        n_episodes=len(late),
        n_arrived=len(arrived),
    )


def clopper_pearson(
    successes: ArrayLike, n_trials: int, coverage: float = 0.95
) -> tuple[FloatArray, FloatArray]:
    """Exact confidence interval of a binomial proportion: quantiles of Beta distributions."""
    count = np.asarray(successes, dtype=np.float64)
    tail = (1.0 - coverage) / 2.0
    quantile = scipy.special.betaincinv
    lower = quantile(np.maximum(count, 1.0), n_trials - count + 1.0, tail)
    upper = quantile(count + 1.0, np.maximum(n_trials - count, 1.0), 1.0 - tail)
    return np.where(count > 0, lower, 0.0), np.where(count < n_trials, upper, 1.0)


def binomial_tail(successes: int, n_trials: int, probability: float) -> float:
    """P(K >= successes) of a binomial K."""
    if successes <= 0:
        return 1.0
    return float(scipy.special.bdtrc(successes - 1, n_trials, probability))


def sampling_band(
    cdf: FloatArray, n_episodes: int, coverage: float = 0.95
) -> tuple[FloatArray, FloatArray]:
    """Where the share of `n_episodes` falls if a predicted CDF is right: binomial quantiles."""
    given = np.asarray(cdf)
    probability = np.clip(np.atleast_2d(given), 0.0, 1.0)  # sums may pass 1 by rounding
    tail = (1.0 - coverage) / 2.0
    counts = (_mixture_quantile(share, n_episodes, probability) for share in (tail, 1.0 - tail))
    lower, upper = (np.reshape(count / n_episodes, given.shape[-1:]) for count in counts)
    return lower, upper


def _mixture_quantile(share: float, n_trials: int, probability: FloatArray) -> IntArray:
    """(T,) smallest count with P(at most that many) >= share, by bisection."""
    low = np.zeros(probability.shape[1], dtype=np.int64)
    high = np.full_like(low, n_trials)
    while np.any(low < high):
        middle = (low + high) // 2
        below = scipy.special.bdtr(middle, n_trials, probability).mean(axis=0) < share
        low, high = np.where(below, middle + 1, low), np.where(below, high, middle)
    return low


#: Series drawn for a probability, and for a power; factors of delay that are tried.
N_SERIES, N_POWER = 2000, 400
LEVEL, POWER = 0.05, 0.8
DELAYS = np.round(np.arange(1.02, 3.001, 0.02), 2)


def crps_s(law: ArrivalLaw, arrival_times_s: ArrayLike) -> float:
    """Score a predicted law F of arrival by measured times: the mean CRPS in seconds, 0 at best.

        CRPS = integral over t of (F(t) - 1[T <= t])^2 up to the last step of the law

    (Gneiting and Raftery, J. Am. Stat. Assoc. 102, 2007). law: a
    `serd_core.arrival.law.ArrivalLaw(times_s, cdf, arrival_probability)`; arrival_times_s: (N,),
    inf for who did not arrive. SerdError without a time, or for NaN.

        print(sc.crps_s(law, [7.2, 8.4, np.inf]))
    """
    measured = _measured(arrival_times_s)
    # Between two steps of the law, or of a measured time, both functions are constant.
    ends = np.unique(np.concatenate([law.times_s, measured[measured < law.times_s[-1]]]))
    predicted = law.probability_by(ends[:-1])
    scores = (predicted[:, None] - (measured <= ends[:-1, None] + SAME_TIME_S)) ** 2
    return float((np.diff(ends) @ scores).mean())


def largest_gap(law: ArrivalLaw, arrival_times_s: ArrayLike) -> float:
    """Largest difference of a law and the measured shares, inf where it did not arrive."""
    return float(_gaps_of(law, _measured(arrival_times_s)[None, :])[0])


def gap_probability(law: ArrivalLaw, arrival_times_s: ArrayLike, seed: int = 0) -> float:
    """Test a predicted law of arrival: probability of a gap as large as measured, if it is right.

    The gap is the largest difference of law and measured shares, (N,) times as in `crps_s`. Series
    are drawn from the law, which may have steps and need not reach 1. Where it is the mean of draws
    of a posterior, each series is drawn from one of these, as the world is one.

        print(sc.gap_probability(law, [7.2, 8.4, np.inf]))
    """
    gap = largest_gap(law, arrival_times_s)
    by_chance = _gaps_by_chance(law, np.size(arrival_times_s), 1.0, N_SERIES, seed)
    return float((1 + np.sum(by_chance >= gap - 1e-12)) / (1 + N_SERIES))


def detectable_delay(law: ArrivalLaw, n: int, seed: int = 0) -> float:
    """Least factor by which n drives must be slower for `gap_probability` to notice it.

    It notices what is below 5 % in four of five series. law: as in `crps_s`. Returns inf where 3
    times as slow are not noticed.

        print(sc.detectable_delay(law, 40))
    """
    limit = float(np.quantile(_gaps_by_chance(law, n, 1.0, N_SERIES, seed), 1.0 - LEVEL))
    low, high = 0, len(DELAYS)
    while low < high:
        middle = (low + high) // 2
        gaps = _gaps_by_chance(law, n, float(DELAYS[middle]), N_POWER, seed + 1)
        if np.mean(gaps > limit) >= POWER:
            high = middle
        else:
            low = middle + 1
    return float(DELAYS[low]) if low < len(DELAYS) else float("inf")


def _gaps_by_chance(law: ArrivalLaw, n: int, delay: float, n_series: int, seed: int) -> FloatArray:
    """(n_series,) gaps of n times that are drawn from the law and then delayed."""
    rng = np.random.default_rng(seed)
    curves = law.cdf[None, :] if law.cdf_draws is None else law.cdf_draws
    shares, times_s = rng.random((n_series, n)), np.append(law.times_s, np.inf)
    place = np.empty(shares.shape, dtype=np.int64)
    of_series = rng.integers(len(curves), size=n_series)
    for number, curve in enumerate(curves):
        rows = of_series == number
        place[rows] = np.searchsorted(curve, shares[rows], side="right")
    return _gaps_of(law, times_s[place] * delay)


def _gaps_of(law: ArrivalLaw, times_s: FloatArray) -> FloatArray:
    """(m,) largest gaps of (m, n) times."""
    steps = law.times_s
    # A time half-way between two steps belongs to the later one.
    ends_s = np.append(0.5 * (steps[:-1] + steps[1:]), steps[-1] + SAME_TIME_S)
    place = np.sort(np.searchsorted(ends_s, times_s, side="right"), axis=1)
    n = place.shape[1]
    # The share of the series differs most from the law where one arrives, and just before.
    law_after = np.append(law.cdf, np.inf)[place]
    law_before = np.append(0.0, law.cdf)[place]
    above = (np.arange(1, n + 1) / n - law_after).max(axis=1)
    below = (law_before - np.arange(n) / n).max(axis=1)
    return np.asarray(np.maximum(above, below))


def _measured(arrival_times_s: ArrayLike) -> FloatArray:
    """(N,) ascending; SerdError without a time, or for NaN."""
    measured = np.sort(np.asarray(arrival_times_s, dtype=np.float64))
    if not measured.size or np.isnan(measured).any():
        raise SerdError(
            f"arrival_times_s must hold at least one time and no NaN, got {measured.tolist()}"
            "; use inf for an episode that did not arrive"
        )
    return measured
