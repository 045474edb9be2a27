"""Summaries of result tables: medians with quartiles, and Welch's t-test between learners."""

from collections.abc import Sequence

import numpy as np
import scipy.stats

from experiments.running.repetitions import Row
from serd_core.arrays import FloatArray


def quartiles(rows: Sequence[Row], measure: str, by: Sequence[str]) -> list[Row]:
    """Median and quartiles of one measure for each combination of the `by` columns."""
    table = []
    for key in _keys(rows, by):
        values = [row[measure] for row in rows if all(row[name] == key[name] for name in by)]
        numbers = np.array(values, dtype=np.float64)
        summary = {"n": float(len(numbers)), "lower": quantile(numbers, 0.25)}
        summary |= {"median": quantile(numbers, 0.5), "upper": quantile(numbers, 0.75)}
        table.append(key | summary)
    return table


def quantile(values: Sequence[float] | FloatArray, share: float) -> float:
    """Linear between neighbouring values, as numpy's, which knows no infinite ones.

    A log-likelihood is -inf where a choice was ruled out; so is then all below the next value.
    """
    ordered = np.sort(np.asarray(values, dtype=np.float64))
    place = share * (len(ordered) - 1)
    below, part = int(place), place % 1.0
    if part == 0.0 or ordered[below] == ordered[below + 1]:
        return float(ordered[below])
    return float((1.0 - part) * ordered[below] + part * ordered[below + 1])


def welch_test(rows: Sequence[Row], measure: str, first: str, second: str) -> list[Row]:
    """Per size: mean difference of two learners and two-sided p-value of Welch's t-test.

    Rows that are not finite are left out and counted; None where fewer than two are left.
    """
    table = []
    for key in _keys(rows, ["size"]):
        samples = [_finite(rows, measure, learner, key["size"]) for learner in (first, second)]
        (one, dropped_one), (two, dropped_two) = samples
        # A t-test needs a spread on both sides.
        enough = min(len(one), len(two)) >= 2
        result = scipy.stats.ttest_ind(one, two, equal_var=False) if enough else None
        table.append(
            {
                "size": key["size"],
                "first": first,
                "second": second,
                "mean_difference": float(np.mean(one) - np.mean(two)) if enough else None,
                "p_value": None if result is None else float(result.pvalue),
                "n_not_finite": dropped_one + dropped_two,
            }
        )
    return table


def _keys(rows: Sequence[Row], by: Sequence[str]) -> list[Row]:
    seen: list[Row] = []
    for row in rows:
        key = {name: row[name] for name in by}
        if key not in seen:
            seen.append(key)
    return seen


def _finite(rows: Sequence[Row], measure: str, learner: str, size: int) -> tuple[list[float], int]:
    values = [
        float(row[measure]) for row in rows if row["learner"] == learner and row["size"] == size
    ]
    finite = [value for value in values if np.isfinite(value)]
    return finite, len(values) - len(finite)
