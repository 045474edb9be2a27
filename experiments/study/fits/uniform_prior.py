"""The M-estimate's uniform prior, as a prior of a SERD fit.

The M-estimator adds c pseudo-observations to every outcome, log P(theta) = c sum_{m,k} log P_m(k).
That is the divergence prior (4.91) to the uniform distribution, with weights that sum to c K in
every model, over states and actions where no wall makes two outcomes one.
"""

import numpy as np

from serd_core.errors import SerdError
from serd_core.grid.navigation import NavigationProblem
from serd_core.posterior.parameters import Block
from serd_core.priors.divergence import KldPrior


def uniform_prior(problem: NavigationProblem, block: Block, pseudo_count: float = 1.0) -> KldPrior:
    """Prior of one block of dynamics; SerdError where walls stand around every use of a model."""
    models = problem.outcome_models
    sorted_successors = np.sort(models.successors, axis=2)
    distinct = (np.diff(sorted_successors, axis=2) != 0).all(axis=2) & models.available
    counts = np.bincount(models.model_of[distinct], minlength=models.n_models)
    if not counts.all():
        raise SerdError(
            f"every outcome model must act somewhere without a wall next to it, got {counts}"
            " such places per model; use a wider scenario"
        )
    weights = pseudo_count * models.n_outcomes / counts[models.model_of]
    return KldPrior(
        weight=1.0,
        reference=np.full((models.n_models, models.n_outcomes), 1.0 / models.n_outcomes),
        block=block,
        state_action_weights=np.where(distinct, weights, 0.0),
    )
