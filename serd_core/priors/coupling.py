"""Prior that keeps the expert's belief similar to the true dynamics (section 4.3).

    log P(theta) = -lambda sum_{s,a,s'} P_T(s'|s,a) log(P_T(s'|s,a) / P_TE(s'|s,a)) - Z

Both models move, so the gradient has a part for each block.
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.dynamics.transition_model import TransitionModel
from serd_core.posterior.derivatives.transition_derivatives import (
    transition_hessian,
    transition_jacobian,
)
from serd_core.posterior.parameters import Block, Parameters
from serd_core.priors.dynamics_prior import (
    dynamics_gradient,
    group_weights,
    transition_probabilities,
)
from serd_core.priors.prior import LogPrior, Prior, require_weight


@dataclass(frozen=True, eq=False)
class CouplingPrior(Prior):
    """Divergence from the true to the believed dynamics, weighted by lambda."""

    weight: float
    state_action_weights: FloatArray | None = None

    def __post_init__(self) -> None:
        require_weight("weight of CouplingPrior", self.weight)

    def evaluate(self, model: TransitionModel, parameters: Parameters) -> LogPrior:
        """Value and gradient by both dynamics blocks."""
        weights = self.weight * group_weights(model, self.state_action_weights)
        truth = transition_probabilities(model, parameters.truth)
        belief = transition_probabilities(model, parameters.belief)
        log_ratio = np.log(truth / belief)
        value = -float(np.sum(weights * truth * log_ratio))
        by_truth = dynamics_gradient(model, parameters.truth, -weights * (log_ratio + 1.0))
        by_belief = dynamics_gradient(model, parameters.belief, weights * truth / belief)
        zeros = parameters.zeros()
        gradient = Parameters(zeros.reward, by_belief, by_truth, zeros.policy)
        return LogPrior(value, gradient)

    def hessian(self, model: TransitionModel, parameters: Parameters) -> FloatArray:
        """Parts of each block, and the mixed part w / P_TE dP_T dP_TE^T."""
        weights = self.weight * group_weights(model, self.state_action_weights)
        truth = transition_probabilities(model, parameters.truth)
        belief = transition_probabilities(model, parameters.belief)
        at_truth, at_belief = parameters.place(Block.TRUTH), parameters.place(Block.BELIEF)
        table = np.zeros((len(parameters.vector),) * 2)
        table[at_truth, at_truth] = transition_hessian(
            model, parameters.truth, -weights * (np.log(truth / belief) + 1.0), -weights / truth
        )
        ratio = weights * truth / belief
        table[at_belief, at_belief] = transition_hessian(
            model, parameters.belief, ratio, -ratio / belief
        )
        everywhere = np.ones(len(weights), dtype=np.bool_)
        by_truth, by_belief = (
            transition_jacobian(model, model.local_jacobian(theta), everywhere)
            for theta in (parameters.truth, parameters.belief)
        )
        mixed = (by_truth * (weights / belief)[:, None]).T @ by_belief
        table[at_truth, at_belief], table[at_belief, at_truth] = mixed, mixed.T
        return table
