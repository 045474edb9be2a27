"""Second derivatives by central differences of a gradient, where no formula is given."""

from collections.abc import Callable

import numpy as np

from serd_core.arrays import FloatArray


def gradient_differences(
    gradient: Callable[[FloatArray], FloatArray], vector: FloatArray, step: float = 1e-5
) -> FloatArray:
    """(n, n) symmetric central differences of a gradient."""
    columns = [
        (gradient(vector + step * unit) - gradient(vector - step * unit)) / (2.0 * step)
        for unit in np.eye(len(vector))
    ]
    table = np.array(columns).reshape(len(vector), len(vector))
    return np.asarray((table + table.T) / 2.0)
