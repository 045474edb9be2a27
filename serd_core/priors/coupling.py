"""Prior that keeps the expert's belief similar to the true dynamics (section 4.3).

    log P(theta) = -lambda sum_{s,a,s'} P_T(s'|s,a) log(P_T(s'|s,a) / P_TE(s'|s,a)) - Z

Both models move, so the gradient has a part for each block.
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray, floored
from serd_core.dynamics.transition_model import TransitionModel
from serd_core.parameters import Parameters
from serd_core.priors.divergence import dynamics_gradient, group_weights
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
        truth = floored(_transition_probabilities(model, parameters.truth))
        belief = floored(_transition_probabilities(model, parameters.belief))
        log_ratio = np.log(truth / belief)
        value = -float(np.sum(weights * truth * log_ratio))
        by_truth = dynamics_gradient(model, parameters.truth, -weights * (log_ratio + 1.0))
        by_belief = dynamics_gradient(model, parameters.belief, weights * truth / belief)
        zeros = parameters.zeros()
        gradient = Parameters(zeros.reward, by_belief, by_truth, zeros.policy)
        return LogPrior(value, gradient)


def _transition_probabilities(model: TransitionModel, theta: FloatArray) -> FloatArray:
    return model.groups.probabilities(model.entries(model.local_probabilities(theta)))
