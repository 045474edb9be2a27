"""A start for SERD that avoids poor local optima: rewards first, then rewards and dynamics.

From random weights, SERD may bend the dynamics to a wrong reward and stay there; with few
demonstrations that happened to about one start in four on the gridworld. Learning the reward
weights under the initial dynamics first (inverse reinforcement learning) gives a start from which
it went well. `serd_core.selection.multi_start` shows the other explanations.
"""

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import StepCallback
from serd_core.ascent.trust_region import TrustRegion
from serd_core.demonstrations.decisions import Decisions
from serd_core.learners.mdce_irl import fit_mdce_irl_by_likelihood
from serd_core.mdp.problem import Problem
from serd_core.posterior.parameters import Block
from serd_core.priors.gaussian import GaussianPrior

#: Wide, but enough to keep weights finite where every demonstration agrees.
_WIDE = GaussianPrior(100.0, Block.REWARD)
_ASCENT = TrustRegion(gradient_tolerance=1e-5)


def weights_under_initial_dynamics(
    problem: Problem,
    decisions: Decisions,
    *,
    dynamics: FloatArray | None = None,
    on_step: StepCallback | None = None,
) -> FloatArray:
    """(F,) most likely weights under the given dynamics (None: the M-estimate), from zero.

    Where that search does not converge its last point is returned: it is only a start. on_step:
    called after each step.
    """
    fit = fit_mdce_irl_by_likelihood(
        problem,
        decisions,
        initial_weights=np.zeros(len(problem.feature_names)),
        dynamics=dynamics,
        prior=_WIDE,
        ascent=_ASCENT,
        on_step=on_step,
    )
    return fit.reward_weights
