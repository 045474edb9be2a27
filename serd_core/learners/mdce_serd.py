"""MDCE SERD: SERD with the maximum discounted causal entropy policy (section 4.4.1).

result = fit_mdce_serd(problem, decisions, rng=rng, prior=KldPrior(weight=1.0))
"""

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import Ascent, StepCallback
from serd_core.demonstrations.decisions import Decisions
from serd_core.learners.fit_result import FitResult
from serd_core.learners.serd import LBFGS, UNIFORM, SerdSettings, fit_serd
from serd_core.learners.start import TIED
from serd_core.mdp.problem import Problem
from serd_core.policies.policy_model import MdcePolicy
from serd_core.posterior.beliefs import Belief
from serd_core.priors.prior import Prior


def fit_mdce_serd(
    problem: Problem,
    decisions: Decisions,
    *,
    initial_weights: FloatArray | None = None,
    rng: np.random.Generator | None = None,
    dynamics: FloatArray | None = None,
    belief: Belief = TIED,
    prior: Prior = UNIFORM,
    ascent: Ascent = LBFGS,
    on_step: StepCallback | None = None,
) -> FitResult:
    """Learn reward weights and dynamics at once from the decisions of a soft expert.

    Arguments as in `fit_serd`, which also takes the solvers by object.
    """
    return fit_serd(
        problem,
        decisions,
        MdcePolicy(),
        SerdSettings(belief=belief, prior=prior, ascent=ascent),
        initial_weights=initial_weights,
        rng=rng,
        dynamics=dynamics,
        on_step=on_step,
    )
