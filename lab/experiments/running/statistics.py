"""Statistics over repetitions: bootstrap intervals of means, paired permutation tests, Holm.

Repetitions are recorded independently of each other, so they are what is resampled. Within one,
all methods learn from the same demonstrations and drive in the same worlds, so differences are
taken within repetitions.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
import scipy.stats
from pydantic import Field

from lab.experiments.running.tables import Row
from serd_core.arrays import FloatArray, IntArray
from serd_files.yaml_config import StrictModel

#: All sign flips up to this many, else as many drawn.
_FLIPS = 9_999


class StatisticsSettings(StrictModel):
    """bootstrap: resamples; coverage: of confidence intervals."""

    bootstrap: int = Field(ge=10)
    coverage: float = Field(gt=0, lt=1)


@dataclass(frozen=True)
class Interval:
    """A number with its bootstrap interval."""

    value: float
    lower: float
    upper: float

    def columns(self, name: str) -> Row:
        """The number under its name, with the interval."""
        return {name: self.value, "lower": self.lower, "upper": self.upper}


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
    values: Sequence[float] | FloatArray, settings: StatisticsSettings, rng: np.random.Generator
) -> Interval:
    """Mean over repetitions; an infinite value makes the mean infinite and the interval NaN."""
    numbers = np.asarray(values, dtype=np.float64)
    if not np.isfinite(numbers).all():
        return Interval(float(numbers.mean()), np.nan, np.nan)
    return bootstrap(len(numbers), lambda drawn: float(numbers[drawn].mean()), settings, rng)


def paired_p_value(
    first: Sequence[float] | FloatArray,
    second: Sequence[float] | FloatArray,
    rng: np.random.Generator,
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
    values: pd.DataFrame, first: str, settings: StatisticsSettings, rng: np.random.Generator
) -> list[Row]:
    """The column `first` minus each other column, one row each; Holm's correction over all.

    values: one row per repetition, one column per method.
    """
    family: list[Row] = []
    ours = values[first].to_numpy()
    for name, theirs in values.drop(columns=first).items():
        difference = mean_interval(ours - theirs.to_numpy(), settings, rng)
        row: Row = {"second": name} | difference.columns("mean_difference")
        family.append(row | {"p_value": paired_p_value(ours, theirs, rng)})
    adjusted = holm([row["p_value"] for row in family])
    return [row | {"p_holm": p} for row, p in zip(family, adjusted, strict=True)]


def holm(p_values: Sequence[float]) -> list[float]:
    """Holm's adjusted p-values of one family of tests (scipy has none); a NaN is not counted."""
    adjusted = np.array(p_values, dtype=np.float64)
    order = np.argsort(adjusted)[: int(np.isfinite(adjusted).sum())]
    steps = (len(order) - np.arange(len(order))) * adjusted[order]
    adjusted[order] = np.maximum.accumulate(np.minimum(steps, 1.0))
    return [float(value) for value in adjusted]
