"""Tables of results: CSV files, medians with quartiles, and Welch's t-test between learners."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import scipy.stats

from serd_bag.files import atomic_write_text
from serd_core.arrays import FloatArray
from serd_core.errors import SerdError

#: One line of a table; None where a number does not apply.
Row = dict[str, Any]


def write_table(path: Path, table: pd.DataFrame) -> None:
    """Write a table as CSV: floats by their shortest exact text, nothing for undefined cells."""
    if table.empty:
        raise SerdError(f"table for {path} must not be empty; run at least one repetition")
    atomic_write_text(path, table.to_csv(index=False, lineterminator="\n"))


def plain_rows(table: pd.DataFrame) -> list[Row]:
    """Rows for JSON, with None for numbers that are not finite."""
    cells = table.astype(object).where(table.notna() & ~table.isin([np.inf, -np.inf]), None)
    rows: list[Row] = cells.to_dict("records")
    return rows


def quartiles(table: pd.DataFrame, measure: str, by: Sequence[str]) -> pd.DataFrame:
    """Median and quartiles of one measure for each combination of the `by` columns."""
    groups = table.groupby(list(by), sort=False)[measure]
    return groups.agg(
        n=lambda values: float(len(values)),
        lower=lambda values: quantile(values, 0.25),
        median=lambda values: quantile(values, 0.5),
        upper=lambda values: quantile(values, 0.75),
    ).reset_index()


def quantile(values: Sequence[float] | FloatArray, share: float) -> float:
    """Quantile by linear interpolation, also next to infinite values, where numpy's is NaN.

    A log-likelihood is -inf where a choice was ruled out; so is then all below the next value.
    """
    ordered = np.sort(np.asarray(values, dtype=np.float64))
    place = share * (len(ordered) - 1)
    below, part = int(place), place % 1.0
    if part == 0.0 or ordered[below] == ordered[below + 1]:
        return float(ordered[below])
    return float((1.0 - part) * ordered[below] + part * ordered[below + 1])


def welch_test(table: pd.DataFrame, measure: str, first: str, second: str) -> list[Row]:
    """Per size: mean difference of two learners and two-sided p-value of Welch's t-test.

    Values that are not finite are left out and counted; None where fewer than two are left.
    """
    rows = []
    for size, chosen in table.groupby("size", sort=False):
        samples = [chosen.loc[chosen["learner"] == name, measure] for name in (first, second)]
        one, two = (values[np.isfinite(values)].to_numpy() for values in samples)
        enough = min(len(one), len(two)) >= 2
        rows.append(
            {
                "size": size,
                "first": first,
                "second": second,
                "mean_difference": float(np.mean(one) - np.mean(two)) if enough else None,
                "p_value": _welch_p_value(one, two) if enough else None,
                "n_not_finite": sum(map(len, samples)) - len(one) - len(two),
            }
        )
    return rows


def _welch_p_value(one: FloatArray, two: FloatArray) -> float:
    return float(scipy.stats.ttest_ind(one, two, equal_var=False).pvalue)


#: Numbers below this are written with an exponent: four decimals would lose their digits.
_SMALL = 1e-3


def print_results(rows: pd.DataFrame, title: str) -> None:
    """Print a table and its title."""
    print(title)
    print(rows.to_string(index=False, na_rep="", float_format=_text))


def _text(value: float) -> str:
    # Likelihoods next to one differ from zero in late digits only.
    return f"{value:.2e}" if 0.0 < abs(value) < _SMALL else f"{value + 0.0:.4f}"
