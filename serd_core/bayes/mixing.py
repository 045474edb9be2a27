"""What draws of chains are worth: how many independent draws would determine them as well.

Of C chains with T states each, which are independent of each other, the share of states below a
quantile q has the variance Var(shares of single chains) / C, so the draws are worth

    effective = C q (1 - q) / Var(shares of single chains)

independent ones. Many chains make this simpler than sums of autocorrelations (Vehtari et al. 2021),
which few chains need. Chains that still drift away from where they started are worth nothing: their
later halves have other shares than the earlier ones.
"""

import numpy as np

from serd_core.arrays import FloatArray

#: Standard errors by which the halves of stationary chains hardly ever differ.
DRIFT = 3.5


def effective_sizes(draws: FloatArray, n_chains: int, shares: FloatArray) -> FloatArray:
    """(...) least number of independent draws that the quantiles of some shares are worth.

    draws: (T C, ...), the states of C chains after each of T sweeps, where an incomplete last sweep
    is left out. 0 where the chains drift, and of a single chain, which nothing is compared with.
    Chains of one state each are independent draws.
    """
    whole = draws[: len(draws) // n_chains * n_chains]
    values = whole.reshape(-1, n_chains, *draws.shape[1:])
    if n_chains == 1:
        return np.zeros(values.shape[2:])
    half, least = len(values) // 2, np.full(values.shape[2:], float(len(whole)))
    if not half:
        return least
    for share, end in zip(shares, np.quantile(whole, shares, axis=0), strict=True):
        below = (values <= end).astype(np.float64)
        spread = below.mean(axis=0).var(axis=0, ddof=1)
        expected = n_chains * share * (1.0 - share)
        worth = np.divide(expected, spread, out=np.full_like(spread, np.inf), where=spread > 0)
        moved = below[len(values) - half :].mean(axis=0) - below[:half].mean(axis=0)
        error = np.std(moved, axis=0, ddof=1) / np.sqrt(n_chains)
        drifts = np.abs(np.mean(moved, axis=0)) > DRIFT * error
        least = np.minimum(least, np.where(drifts, 0.0, worth))
    return np.asarray(least)
