"""Cells and lines of the Markdown tables: numbers with their ranges, shares, p-values."""

from collections.abc import Iterable, Sequence

import numpy as np

from experiments.running.repetitions import Row

EXPERT_NAMES = {
    "people": "scripted people",
    "knows": "knows the crowd",
    "ignores_crowd": "ignores the crowd",
    "fears_crowd": "fears the crowd",
}


def table_text(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [list(header), ["---"] * len(header), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def number(value: str, digits: int = 3) -> str:
    """A number with a proper minus, and none before a zero."""
    rounded = round(float(value), digits) + 0.0
    return f"{rounded:.{digits}f}".replace("-", "−").replace("inf", "∞")


def with_range(row: Row, name: str, digits: int = 3) -> str:
    """`middle (lower to upper)` of a row with those columns; no range where that is infinite."""
    if not np.isfinite(float(row[name])):
        return number(row[name])
    low, high = number(row["lower"], digits), number(row["upper"], digits)
    return f"{number(row[name], digits)} ({low} to {high})"


def around(row: Row, name: str, digits: int = 3) -> str:
    """`value (lower to upper)` of a number whose interval stands in columns of its name."""
    low, high = (number(row[f"{name}_{end}"], digits) for end in ("lower", "upper"))
    return f"{number(row[name], digits)} ({low} to {high})"


def difference(row: Row) -> str:
    """The mean; for all but the baseline the difference to it, bold where the test finds one."""
    mean = number(row["mean"])
    if not row["p_holm"]:
        return mean
    value = number(row["difference"])
    signed = value if value.startswith("−") or value.strip("0.") == "" else f"+{value}"
    # What rounds to nothing may still be of one sign in every repetition.
    found = float(row["p_holm"]) < 0.05 and value.strip("−0.") != ""
    return f"**{signed}**" if found else signed


def seconds(value: str) -> str:
    """A time with a tenth of a second."""
    return f"{number(value, 1)} s"


def percent(value: str) -> str:
    """A share as a percentage."""
    return f"{100 * float(value):.1f} %"


def p_value(row: Row) -> str:
    """The p-value after Holm's correction."""
    value = float(row["p_holm"])
    if np.isnan(value):
        return "–"
    return "< 0.001" if value < 0.001 else f"{value:.3f}"
