"""How well a law of arrival agrees with measured times: a proper score, and a test with its power.

Two curves measured in one world differ by chance: those of 20 and of 40 drives by .2 in the median.
So a gap between a prediction and a series of drives says something only beside the gap that chance
makes, and a test that finds none only beside the error that it would find.
"""

import numpy as np
from numpy.typing import ArrayLike

from serd_core.arrays import FloatArray
from serd_core.arrival.law import SAME_TIME_S, ArrivalLaw
from serd_core.errors import SerdError

#: Series drawn for a probability, and for a power; factors of delay that are tried.
N_SERIES, N_POWER = 2000, 400
LEVEL, POWER = 0.05, 0.8
DELAYS = np.round(np.arange(1.02, 3.001, 0.02), 2)


def crps_s(law: ArrivalLaw, arrival_times_s: ArrayLike) -> float:
    """Mean continuous ranked probability score (s) of measured times, inf without an arrival.

        CRPS = integral over t of (F(t) - 1[T <= t])^2 up to the last step of the law

    (Gneiting and Raftery, J. Am. Stat. Assoc. 102, 2007). SerdError without a time.
    """
    measured = _measured(arrival_times_s)
    # Between two steps of the law, or of a measured time, both functions are constant.
    ends = np.unique(np.concatenate([law.times_s, measured[measured < law.times_s[-1]]]))
    predicted = law.probability_by(ends[:-1])
    scores = (predicted[:, None] - (measured <= ends[:-1, None] + SAME_TIME_S)) ** 2
    return float((np.diff(ends) @ scores).mean())


def largest_gap(law: ArrivalLaw, arrival_times_s: ArrayLike) -> float:
    """Largest difference of a law and the measured shares, inf where it did not arrive.

    At the steps of the law, to whose nearest one each time is rounded: the Kolmogorov-Smirnov
    distance of the rounded times. SerdError without a time.
    """
    return float(_gaps_of(law, _measured(arrival_times_s)[None, :])[0])


def gap_probability(law: ArrivalLaw, arrival_times_s: ArrayLike, seed: int = 0) -> float:
    """Probability of a gap as large as that of the measured times if the law is right.

    By series drawn from the law itself, which may have steps and need not reach 1. Where it is the
    mean of draws of a posterior, each series is drawn from one of these, as the world is one.
    SerdError without a time.
    """
    gap = largest_gap(law, arrival_times_s)
    by_chance = _gaps_by_chance(law, np.size(arrival_times_s), 1.0, N_SERIES, seed)
    return float((1 + np.sum(by_chance >= gap - 1e-12)) / (1 + N_SERIES))


def detectable_delay(law: ArrivalLaw, n: int, seed: int = 0) -> float:
    """Least factor by which n drives must be slower for the test to notice in four of five series.

    The test rejects at 5 %. inf where 3 times as slow are not noticed.
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
