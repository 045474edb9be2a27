"""The smallest convex combination of gradients: what is left where they cancel each other."""

import numpy as np
import scipy.optimize

from serd_core.arrays import FloatArray

#: Weight of the row that makes the shares sum to one; they are normalised afterwards.
SUM_WEIGHT = 1e4


def smallest_mean(gradients: FloatArray) -> FloatArray:
    """(n,) mean of (k, n) gradients with the shares that make it shortest.

        min |sum_j w_j g_j|  over  w >= 0, sum w = 1

    as non-negative least squares with one more row for the sum.
    """
    scale = float(np.max(np.abs(gradients), initial=0.0))
    if scale == 0.0:
        return np.zeros(gradients.shape[1])
    count = len(gradients)
    table = np.vstack([gradients.T / scale, np.full(count, SUM_WEIGHT)])
    wanted = np.append(np.zeros(gradients.shape[1]), SUM_WEIGHT)
    shares, _ = scipy.optimize.nnls(table, wanted, maxiter=100 * count)
    return np.asarray((shares / shares.sum()) @ gradients)
