"""Prior that favours undecided dynamics (Eqs. 4.88 to 4.90).

    log P(theta) = lambda sum_{s,a} w(s,a) sum_s' -P(s'|s,a) log P(s'|s,a) - Z

The thesis has w = 1 everywhere.
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.dynamics.transition_model import TransitionModel
from serd_core.posterior.parameters import Block
from serd_core.priors.dynamics_prior import DynamicsPrior


@dataclass(frozen=True, eq=False)
class EntropyPrior(DynamicsPrior):
    """Entropy of the block's transition distributions, weighted by lambda."""

    weight: float
    block: Block = Block.TRUTH
    state_action_weights: FloatArray | None = None
    mean_over_pairs: bool = False

    def terms(
        self, model: TransitionModel, weights: FloatArray, probability: FloatArray
    ) -> tuple[float, FloatArray, FloatArray]:
        """(4.88); -w (log P + 1), as in (4.89); -w / P."""
        del model
        logs = np.log(probability)
        value = -float(np.sum(weights * probability * logs))
        return value, -weights * (logs + 1.0), -weights / probability
