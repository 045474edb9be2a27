"""Types of arrays, and arithmetic on them that several modules share."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

#: Probabilities below this count as this in logarithms.
SMALLEST_PROBABILITY = 1e-300


def floored(probabilities: FloatArray) -> FloatArray:
    """Probabilities with a positive floor, so that logarithms stay finite."""
    return np.maximum(probabilities, SMALLEST_PROBABILITY)


def weighted_counts(index: IntArray, weights: FloatArray, size: int) -> FloatArray:
    """(size,) sum of the weights that share an index."""
    return np.asarray(np.bincount(index, weights=weights, minlength=size), dtype=np.float64)


def padded(table: FloatArray | NDArray[np.floating[Any]], shape: tuple[int, ...]) -> FloatArray:
    """The table in the first places of one of a larger shape, which is 0 elsewhere."""
    return np.pad(
        np.asarray(table, dtype=np.float64),
        [(0, whole - size) for whole, size in zip(shape, table.shape, strict=True)],
    )


def largest_per_row(table: FloatArray) -> FloatArray:
    """(S,) maximum over the actions of an (S, A) table."""
    return np.asarray(np.maximum.reduce(np.ascontiguousarray(table.T), axis=0))


def sum_per_row(table: FloatArray) -> FloatArray:
    """(S,) sum over the actions of an (S, A) table of finite numbers, as a product with ones."""
    return np.asarray(table @ np.ones(table.shape[1]))


def first_index(mask: BoolArray | np.bool_) -> tuple[int, ...] | None:
    """Index of the first true entry of `mask` in row-major order, None when there is none."""
    if not mask.any():
        return None
    return tuple(int(i) for i in np.unravel_index(int(np.argmax(mask)), mask.shape))


def gradient_differences(
    gradient: Callable[[FloatArray], FloatArray], vector: FloatArray, step: float = 1e-5
) -> FloatArray:
    """(n, n) symmetric central differences of a gradient."""
    above_and_below = ((vector + step * unit, vector - step * unit) for unit in np.eye(len(vector)))
    rows = [(gradient(a) - gradient(b)) / (2.0 * step) for a, b in above_and_below]
    table = np.array(rows).reshape(len(vector), len(vector))
    return np.asarray((table + table.T) / 2.0)


def described(parts: FloatArray, names: Sequence[str], share: float = 0.25) -> str:
    """What moves along a direction (n,), as shares of the largest, largest first."""
    parts = parts / np.max(np.abs(parts))
    order = np.argsort(-np.abs(parts), kind="stable")
    order = order[np.abs(parts[order]) >= share]
    return ", ".join(f"{parts[i]:+.2f} {names[i]}" for i in order[:6])
