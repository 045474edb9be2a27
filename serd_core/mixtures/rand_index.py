"""Agreement of two partitions of the same things."""

import numpy as np

from serd_core.arrays import FloatArray, IntArray, int_array
from serd_core.errors import SerdError


def adjusted_rand_index(first: IntArray, second: IntArray) -> float:
    """1 for equal partitions, 0 on average for random ones (Hubert and Arabie 1985).

    first, second: (n,) labels; which numbers they are does not matter.
    """
    one = int_array("first", first, (None,))
    other = int_array("second", second, (len(one),))
    if len(one) < 2:
        raise SerdError(f"first must hold at least 2 labels, got {len(one)}; compare more things")
    _, row = np.unique(one, return_inverse=True)
    _, column = np.unique(other, return_inverse=True)
    table = np.zeros((row.max() + 1, column.max() + 1))
    np.add.at(table, (row, column), 1.0)
    both = _pairs(table)
    by_row, by_column = _pairs(table.sum(axis=1)), _pairs(table.sum(axis=0))
    expected = by_row * by_column / _pairs(np.array([float(len(one))]))
    highest = 0.5 * (by_row + by_column)
    return 1.0 if highest == expected else float((both - expected) / (highest - expected))


def _pairs(counts: FloatArray) -> float:
    """Pairs of things within the same part."""
    return float(np.sum(counts * (counts - 1.0) / 2.0))
