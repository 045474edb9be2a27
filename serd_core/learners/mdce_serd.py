"""MDCE SERD: SERD with the maximum discounted causal entropy policy (section 4.4.1).

result = fit_mdce_serd(problem, decisions, rng=rng, prior=KldPrior(weight=1.0))
"""

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import Ascent
from serd_core.demonstrations.decisions import Decisions
from serd_core.learners.fit_result import FitResult
from serd_core.learners.serd import (
    LBFGS,
    TIED,
    UNIFORM,
    OnStep,
    SerdSettings,
    fit_serd,
    initial_dynamics_or_estimate,
    initial_weights_or_sample,
)
from serd_core.mdp.problem import Problem
from serd_core.policies.mdce import MdcePolicy
from serd_core.posterior.beliefs import Belief
from serd_core.priors.prior import Prior


def fit_mdce_serd(
    problem: Problem,
    decisions: Decisions,
    *,
    initial_weights: FloatArray | None = None,
    rng: np.random.Generator | None = None,
    initial_dynamics: FloatArray | None = None,
    belief: Belief = TIED,
    prior: Prior = UNIFORM,
    ascent: Ascent = LBFGS,
    on_step: OnStep | None = None,
) -> FitResult:
    """Learn reward weights and dynamics at once from the decisions of a soft expert.

    initial_weights: (F,), or None for a sample of U[-10, 10] from `rng`.
    initial_dynamics: (M, K) probabilities, or the parameters of a SparseModel; None for the
    M-estimate with a uniform prior.
    on_step: told after each step; returning True stops the fit.
    `fit_serd` also takes the solvers by object.
    """
    return fit_serd(
        problem,
        decisions,
        MdcePolicy(),
        SerdSettings(belief=belief, prior=prior, ascent=ascent),
        initial_weights=initial_weights_or_sample(problem, initial_weights, rng),
        initial_dynamics=initial_dynamics_or_estimate(problem, decisions, initial_dynamics),
        on_step=on_step,
    )
