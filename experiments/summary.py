"""Summaries of result tables: medians with quartiles, and Welch's t-test between learners."""

from collections.abc import Sequence

import numpy as np
import scipy.stats

from experiments.repetitions import Row


def quartiles(rows: Sequence[Row], measure: str, by: Sequence[str]) -> list[Row]:
    """Median and quartiles of one measure for each combination of the `by` columns."""
    table = []
    for key in _keys(rows, by):
        values = [row[measure] for row in rows if all(row[name] == key[name] for name in by)]
        numbers = np.array(values, dtype=np.float64)
        # Quartiles are order statistics, so that -inf (a choice ruled out) has its place in them.
        low, middle, high = np.quantile(numbers, [0.25, 0.5, 0.75], method="inverted_cdf")
        summary = {"n": len(numbers), "lower": low, "median": middle, "upper": high}
        table.append(key | {name: float(value) for name, value in summary.items()})
    return table


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
