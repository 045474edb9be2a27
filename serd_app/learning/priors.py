"""The M-estimate's uniform prior, as a prior of a SERD fit.

The M-estimator adds c pseudo-observations to every outcome, log P(theta) = c sum_{m,k} log P_m(k).
That is the divergence prior (4.91) to the uniform distribution, with weights that sum to c K in
every model. It is taken over the states and actions where walls make the fewest outcomes one: none
in a hallway of some width.
"""

import numpy as np

from serd_core.grid.navigation import NavigationProblem
from serd_core.posterior.parameters import Block
from serd_core.priors.divergence import KldPrior
from serd_core.priors.prior import Prior


def uniform_prior(problem: NavigationProblem, block: Block, pseudo_count: float) -> KldPrior:
    """Prior of one block of dynamics; it leaves out models that act nowhere."""
    models = problem.outcome_models
    n_distinct = 1 + (np.diff(np.sort(models.successors, axis=2)) != 0).sum(axis=2)
    n_distinct = np.where(models.available, n_distinct, 0)
    most = np.zeros(models.n_models, dtype=np.int64)
    np.maximum.at(most, models.model_of, n_distinct)
    used = models.available & (n_distinct == most[models.model_of])
    counts = np.bincount(models.model_of[used], minlength=models.n_models)
    weights = pseudo_count * models.n_outcomes / np.maximum(counts, 1)[models.model_of]
    return KldPrior(
        weight=1.0,
        reference=np.full((models.n_models, models.n_outcomes), 1.0 / models.n_outcomes),
        block=block,
        state_action_weights=np.where(used, weights, 0.0),
    )


def uniform_prior_on_both(problem: NavigationProblem, pseudo_count: float) -> Prior:
    """The same on the truth and on the belief, where these are two blocks."""
    truth = uniform_prior(problem, Block.TRUTH, pseudo_count)
    return truth + uniform_prior(problem, Block.BELIEF, pseudo_count)
