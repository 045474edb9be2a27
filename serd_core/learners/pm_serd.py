"""PM SERD: SERD with a Boltzmann policy over optimal Q-values (section 4.4.2).

The temperature theta_P is learned with rewards and dynamics. Scaling all rewards and theta_P by
one factor changes nothing, so demonstrations determine their ratio only. A prior that holds theta_P
near a value fixes the scale and does not change the likelihood; one that only shrinks rewards and
temperature has no maximum, as both then go to zero together.

    fit = fit_pm_serd(problem, decisions, rng=rng, prior=GaussianPrior(0.1, Block.POLICY, 1.0))
"""

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import Ascent, StepCallback
from serd_core.ascent.kinked import KinkedAscent
from serd_core.demonstrations.decisions import Decisions
from serd_core.learners.fit_result import FitResult
from serd_core.learners.serd import UNIFORM, SerdSettings, fit_serd
from serd_core.learners.start import TIED
from serd_core.mdp.problem import Problem
from serd_core.policies.policy_model import PolicyMatchingPolicy
from serd_core.posterior.beliefs import Belief
from serd_core.priors.prior import Prior

KINKED = KinkedAscent()


def fit_pm_serd(
    problem: Problem,
    decisions: Decisions,
    *,
    initial_weights: FloatArray | None = None,
    rng: np.random.Generator | None = None,
    dynamics: FloatArray | None = None,
    initial_temperature: float = 1.0,
    belief: Belief = TIED,
    prior: Prior = UNIFORM,
    ascent: Ascent = KINKED,
    on_step: StepCallback | None = None,
) -> FitResult:
    """Learn rewards, dynamics and temperature of an expert who knows the optimal Q-values.

    Arguments as in `fit_serd`; initial_temperature: theta_P to start from. The objective has kinks
    where the greedy policy changes, and most maxima lie on one: `KinkedAscent` finds and certifies
    them, smooth ascents stop there and report that they did not converge.
    """
    return fit_serd(
        problem,
        decisions,
        PolicyMatchingPolicy(start_temperature=initial_temperature),
        SerdSettings(belief=belief, prior=prior, ascent=ascent),
        initial_weights=initial_weights,
        rng=rng,
        dynamics=dynamics,
        on_step=on_step,
    )
