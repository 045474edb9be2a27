"""Statistics over repetitions: bootstrap intervals of means, paired permutation tests, Holm.

Repetitions are recorded independently of each other, so they are what is resampled. Within one,
all methods see the same demonstrations and worlds, so differences are taken within repetitions.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.stats

from experiments.running.repetitions import Row
from experiments.study.settings import StatisticsSettings
from serd_core.arrays import IntArray

#: All sign flips up to this many, else as many drawn.
_FLIPS = 9_999


@dataclass(frozen=True)
class Interval:
    """A number with its bootstrap interval."""

    value: float
    lower: float
    upper: float


def bootstrap(
    n_repetitions: int,
    statistic: Callable[[IntArray], float],
    settings: StatisticsSettings,
    rng: np.random.Generator,
) -> Interval:
    """Percentile interval of a statistic of repetitions, given as an array of their indices."""
    every = np.arange(n_repetitions)
    value = float(statistic(every))
    drawn = scipy.stats.bootstrap(
        (every,),
        statistic,
        n_resamples=settings.bootstrap,
        confidence_level=settings.coverage,
        method="percentile",
        vectorized=False,
        rng=rng,
    )
    low, high = drawn.confidence_interval
    return Interval(value, float(low), float(high))


def mean_interval(
    values: Sequence[float], settings: StatisticsSettings, rng: np.random.Generator
) -> Interval:
    """Mean over repetitions; where one is infinite so is the mean, and no interval is known."""
    numbers = np.asarray(values, dtype=np.float64)
    if not np.isfinite(numbers).all():
        return Interval(float(numbers.mean()), np.nan, np.nan)
    return bootstrap(len(numbers), lambda drawn: float(numbers[drawn].mean()), settings, rng)


def paired_p_value(
    first: Sequence[float], second: Sequence[float], rng: np.random.Generator
) -> float:
    """Two-sided p-value that the mean difference within repetitions is zero, by flipping signs."""
    difference = np.asarray(first, dtype=np.float64) - np.asarray(second, dtype=np.float64)
    if not np.isfinite(difference).all():
        return float("nan")
    if not difference.any():
        return 1.0
    found = scipy.stats.permutation_test(
        (difference,),
        lambda values, axis: values.mean(axis=axis),
        permutation_type="samples",
        vectorized=True,
        n_resamples=_FLIPS,
        rng=rng,
    )
    return float(found.pvalue)


def paired_family(
    first: Sequence[float],
    others: Mapping[str, Sequence[float]],
    settings: StatisticsSettings,
    rng: np.random.Generator,
) -> list[Row]:
    """First minus each other within repetitions, one row each; Holm over all of them."""
    family: list[Row] = []
    for name, values in others.items():
        difference = mean_interval(np.subtract(first, values).tolist(), settings, rng)
        family.append(
            {
                "second": name,
                "mean_difference": difference.value,
                "lower": difference.lower,
                "upper": difference.upper,
                "p_value": paired_p_value(first, values, rng),
            }
        )
    adjusted = holm([row["p_value"] for row in family])
    return [row | {"p_holm": p} for row, p in zip(family, adjusted, strict=True)]


def holm(p_values: Sequence[float]) -> list[float]:
    """Holm's adjusted p-values of one family of tests; NaN stays NaN and counts for nothing."""
    adjusted = np.array(p_values, dtype=np.float64)
    order = [int(i) for i in np.argsort(adjusted) if np.isfinite(adjusted[i])]
    highest = 0.0
    for rank, index in enumerate(order):
        highest = max(highest, min(1.0, (len(order) - rank) * float(p_values[index])))
        adjusted[index] = highest
    return [float(value) for value in adjusted]
