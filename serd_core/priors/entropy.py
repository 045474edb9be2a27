"""Prior that favours undecided dynamics (Eqs. 4.88 to 4.90).

    log P(theta) = lambda sum_{s,a} w(s,a) sum_s' -P(s'|s,a) log P(s'|s,a) - Z

The thesis has w = 1 everywhere.
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray, floored
from serd_core.derivatives.transition_derivatives import transition_hessian
from serd_core.dynamics.transition_model import TransitionModel
from serd_core.posterior.parameters import Block, Parameters
from serd_core.priors.divergence import (
    dynamics_gradient,
    group_weights,
    require_dynamics_block,
)
from serd_core.priors.prior import LogPrior, Prior, require_weight


@dataclass(frozen=True, eq=False)
class EntropyPrior(Prior):
    """Entropy of the block's transition distributions, weighted by lambda."""

    weight: float
    block: Block = Block.TRUTH
    state_action_weights: FloatArray | None = None

    def __post_init__(self) -> None:
        require_weight("weight of EntropyPrior", self.weight)
        require_dynamics_block("EntropyPrior", self.block)

    def evaluate(self, model: TransitionModel, parameters: Parameters) -> LogPrior:
        """Value (4.88) and gradient (4.89)."""
        theta = parameters.block(self.block)
        entries = model.entries(model.local_probabilities(theta))
        probability = floored(model.groups.probabilities(entries))
        weights = self.weight * group_weights(model, self.state_action_weights)
        log_probability = np.log(probability)
        value = -float(np.sum(weights * probability * log_probability))
        gradient = dynamics_gradient(model, theta, -weights * (log_probability + 1.0))
        return LogPrior(value, parameters.zeros().with_block(self.block, gradient))

    def hessian(self, model: TransitionModel, parameters: Parameters) -> FloatArray:
        """Of h(P) = -w P log P: h' = -w (log P + 1), h'' = -w / P."""
        theta = parameters.block(self.block)
        entries = model.entries(model.local_probabilities(theta))
        probability = floored(model.groups.probabilities(entries))
        weights = self.weight * group_weights(model, self.state_action_weights)
        table = np.zeros((len(parameters.vector),) * 2)
        place = parameters.place(self.block)
        table[place, place] = transition_hessian(
            model, theta, -weights * (np.log(probability) + 1.0), -weights / probability
        )
        return table
