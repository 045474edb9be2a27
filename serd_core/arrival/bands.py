"""Measured times of arrival as an empirical CDF, and 95 % bands for it and for predictions.

All episodes are cut off at the same horizon, so the share of episodes that arrived by time t
estimates F(t) without bias for every t up to the horizon.

Both bands are *pointwise*: each time by itself is covered with the stated probability, the whole
curve with less.
"""

from dataclasses import dataclass

import numpy as np
import scipy  # loads special and stats at their first use
from numpy.typing import ArrayLike

from serd_core.arrays import FloatArray, IntArray, shown
from serd_core.errors import SerdError


@dataclass(frozen=True, eq=False)
class EmpiricalArrival:
    """Share of episodes that arrived, as a step function with a band.

    times_s: (n,) 0, the distinct times of arrival, the horizon; cdf, lower, upper: (n,) from each
    time up to the next.
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
    beta = scipy.stats.beta
    lower = beta.ppf(tail, np.maximum(count, 1.0), n_trials - count + 1.0)
    upper = beta.ppf(1.0 - tail, count + 1.0, np.maximum(n_trials - count, 1.0))
    return np.where(count > 0, lower, 0.0), np.where(count < n_trials, upper, 1.0)


def binomial_tail(successes: int, n_trials: int, probability: float) -> float:
    """P(K >= successes) of a binomial K.

    >>> round(binomial_tail(2, 3, 0.1), 3)
    0.028
    """
    if successes <= 0:
        return 1.0
    return float(scipy.special.bdtrc(successes - 1, n_trials, probability))


def sampling_band(
    cdf: FloatArray, n_episodes: int, coverage: float = 0.95
) -> tuple[FloatArray, FloatArray]:
    """Where the share of `n_episodes` falls if a predicted CDF is right: binomial quantiles.

    cdf: (T,) or a number, or (n, T) by n draws of a posterior: quantiles of the mixture of their
    binomials. Returns lower and upper of shape (T,), or numbers.
    Pointwise; discreteness makes the true coverage at least the stated one.
    """
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
