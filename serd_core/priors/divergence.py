"""Prior that keeps dynamics close to a reference model (Eq. 4.91).

    log P(theta) = -lambda sum_{s,a} w(s,a) sum_s' Q(s'|s,a) log(Q(s'|s,a) / P_theta(s'|s,a)) - Z

The thesis has w = 1 everywhere. Its gradient is +lambda sum Q dP/P: the sign printed in (4.92) is
wrong, as the finite difference shows.
"""

from dataclasses import dataclass, replace

import numpy as np

from serd_core.arrays import FloatArray, floored
from serd_core.dynamics.transition_model import TransitionModel, transitions_of
from serd_core.errors import SerdError
from serd_core.posterior.parameters import Block
from serd_core.priors.dynamics_prior import DynamicsPrior
from serd_core.priors.prior import Prior


@dataclass(frozen=True, eq=False)
class KldPrior(DynamicsPrior):
    """Kullback-Leibler divergence from a reference Q to the block's P, weighted by lambda.

    reference: local probabilities of Q; None for the learner's initial dynamics.
    """

    weight: float
    reference: FloatArray | None = None
    block: Block = Block.TRUTH
    state_action_weights: FloatArray | None = None
    mean_over_pairs: bool = False

    def anchored(self, initial_local_probabilities: FloatArray) -> Prior:
        """Take the initial dynamics as reference where none was given."""
        if self.reference is not None:
            return self
        return replace(self, reference=initial_local_probabilities)

    def terms(
        self, model: TransitionModel, weights: FloatArray, probability: FloatArray
    ) -> tuple[float, FloatArray, FloatArray]:
        """(4.91); w Q / P; -w Q / P^2. What the reference rules out does not count: 0 log 0 = 0."""
        reference = self._reference(model)
        logs = np.log(floored(reference) / probability)
        ratio = weights * reference / probability
        return -float(np.sum(weights * reference * logs)), ratio, -ratio / probability

    def _reference(self, model: TransitionModel) -> FloatArray:
        """(G,) Q of each distinct transition; SerdError where a row of it is no distribution."""
        if self.reference is None:
            raise SerdError("reference of KldPrior must be given here; pass local probabilities")
        return model.groups.probabilities(transitions_of(model, self.reference).entries)
