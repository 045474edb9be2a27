"""Evidence of a mixture of T types by Laplace's approximation at one maximum.

The posterior has a copy of each maximum for each of the T! orders of the types. Its integral is T!
times that over the points that are nearer to one copy than to the others, a share h of the normal
distribution around that copy:

    log P(D | T) = log T! + log h + J(u*) + c + D/2 log(2 pi) - 1/2 log det M + log |dw/du| + s

with the terms of `serd_core.bayes.laplace`. For types far apart h = 1, for k equal ones h = 1 / k!,
so that equal types add no evidence by their orders.
"""

from itertools import permutations

import numpy as np
from scipy.special import gammaln

from serd_core.arrays import FloatArray
from serd_core.bayes.laplace import LONGEST_STEP, dirichlet_correction, inverse_root, stirling
from serd_core.errors import SerdError
from serd_core.mixtures.coordinates import MixtureCoordinates
from serd_core.mixtures.mixture_posterior import MixtureLogPosterior, MixturePoint
from serd_core.posterior.coordinates import Coordinates
from serd_core.posterior.parameters import Block

#: Draws by which the share of an order is estimated.
N_DRAWS = 2000


def laplace_of_mixture(
    objective: MixtureLogPosterior, mode: FloatArray
) -> tuple[FloatArray, float]:
    """Root of the covariance, and log P(D | T); SerdError where the mode is no maximum."""
    space, at = objective.space, objective.at(mode)
    value, gradient = objective.evaluate(mode)
    root, log_det = inverse_root(
        -objective.hessian(mode), objective.prior_information(mode), space.describe
    )
    step = float(np.linalg.norm(root.T @ gradient))
    if not step <= LONGEST_STEP:
        raise SerdError(f"not converged: the Newton step is {step:.3g} standard errors long")
    half = 0.5 * (len(mode) * np.log(2.0 * np.pi) - log_det)
    corrections = _corrections(objective, at, mode, root)
    orders = float(gammaln(space.n_types + 1)) + np.log(share_of_order(space, mode, root))
    constant = objective.log_constant(mode)
    return root, orders + value + constant + float(half) + corrections


def share_of_order(space: MixtureCoordinates, mode: FloatArray, root: FloatArray) -> float:
    """h, the probability that a draw around the mode is nearer to it than to its reorderings.

    A draw that is equally near to several counts in parts.
    """
    if space.n_types == 1:
        return 1.0
    noise = np.random.default_rng(0).standard_normal((N_DRAWS, root.shape[1]))
    drawn = _by_type(space, mode + noise @ root.T)
    likeness = np.einsum("ntq,uq->ntu", drawn, _by_type(space, mode[None])[0])
    orders = np.array(list(permutations(range(space.n_types))))
    found = likeness[:, np.arange(space.n_types), orders].sum(axis=2)
    rounding = 1e-9 * np.abs(found).max()
    best = found >= found.max(axis=1, keepdims=True) - rounding
    # At least what one more draw would add, so that the logarithm is finite.
    return max(float(np.mean(best[:, 0] / best.sum(axis=1))), 1.0 / N_DRAWS)


def _by_type(space: MixtureCoordinates, vectors: FloatArray) -> FloatArray:
    """(n, T, q) what differs between types, of vectors (n, D): share, rewards, belief."""
    shares = vectors @ space.share_table.T
    return np.concatenate([shares[:, :, None], vectors[:, space.own]], axis=2)


def _corrections(
    objective: MixtureLogPosterior, at: MixturePoint, mode: FloatArray, root: FloatArray
) -> float:
    """Stirling's corrections of the shared dynamics, of beliefs and of the shares."""
    space, total = objective.space, 0.0
    for number, posterior in enumerate(at.posteriors):
        own = Coordinates(space.belief, space.like, space.tables[number], space.names, 0.0)
        groups = [g for g in space.belief.groups if number == 0 or Block.TRUTH not in g]
        total += stirling(posterior, own, mode, root, groups)
    if space.n_types > 1:
        shares = np.exp(at.log_shares)[None]
        total += dirichlet_correction(shares, (space.share_table @ root)[None])
    return total
