"""Checks of report inputs beyond those of serd_core; each failure is one sentence."""

from typing import Any

import numpy as np

from report.errors import ReportError
from serd_core.arrays import FloatArray, first_index, float_array


def finite_number(name: str, value: float) -> float:
    """`value` as a float; NaN and infinity are refused."""
    number = float(value)
    if not np.isfinite(number):
        raise ReportError(f"{name} must be a finite number, got {number}; leave out the bad sample")
    return number


def array_with_gaps(name: str, values: Any, shape: tuple[int | None, ...]) -> FloatArray:
    """Read-only float copy of `values` in which NaN marks a gap; infinity is refused."""
    array = np.array(values, dtype=np.float64)
    infinite = first_index(np.isinf(array))
    if infinite is not None:
        raise ReportError(
            f"{name}{list(infinite)} must be a number or NaN, got {array[infinite]}; repair it"
        )
    float_array(name, np.nan_to_num(array), shape)
    array.flags.writeable = False
    return array
