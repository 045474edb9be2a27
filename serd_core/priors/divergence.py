"""Prior that keeps dynamics close to a reference model (Eq. 4.91).

    log P(theta) = -lambda sum_{s,a} w(s,a) sum_s' Q(s'|s,a) log(Q(s'|s,a) / P_theta(s'|s,a)) - Z

The thesis has w = 1 everywhere. Its gradient is +lambda sum Q dP/P: the sign printed in (4.92) is
wrong, as the finite difference shows.
"""

from dataclasses import dataclass, replace

import numpy as np

from serd_core.arrays import FloatArray, first_index, float_array, floored
from serd_core.derivatives.transition_derivatives import log_transition_hessian
from serd_core.dynamics.transition_model import TransitionModel, transitions_of
from serd_core.errors import SerdError
from serd_core.posterior.parameters import Block, Parameters
from serd_core.priors.prior import LogPrior, Prior, require_weight


@dataclass(frozen=True, eq=False)
class KldPrior(Prior):
    """Kullback-Leibler divergence from a reference Q to the block's P, weighted by lambda.

    reference: local probabilities of Q; None for the learner's initial dynamics.
    state_action_weights: (S, A) weights w; None for one everywhere.
    """

    weight: float
    reference: FloatArray | None = None
    block: Block = Block.TRUTH
    state_action_weights: FloatArray | None = None

    def __post_init__(self) -> None:
        require_weight("weight of KldPrior", self.weight)
        require_dynamics_block("KldPrior", self.block)

    def anchored(self, initial_local_probabilities: FloatArray) -> Prior:
        """Take the initial dynamics as reference where none was given."""
        if self.reference is not None:
            return self
        return replace(self, reference=initial_local_probabilities)

    def evaluate(self, model: TransitionModel, parameters: Parameters) -> LogPrior:
        """Value (4.91) and gradient."""
        theta = parameters.block(self.block)
        local = model.local_probabilities(theta)
        reference = self._reference(model)
        weights = self.weight * group_weights(model, self.state_action_weights)
        present = floored(model.groups.probabilities(model.entries(local)))
        # 0 log 0 = 0: transitions that the reference rules out do not count.
        logs = np.log(floored(reference) / present)
        value = -float(np.sum(weights * reference * logs))
        group_gradient = weights * reference / present
        gradient = dynamics_gradient(model, theta, group_gradient)
        return LogPrior(value, parameters.zeros().with_block(self.block, gradient))

    def hessian(self, model: TransitionModel, parameters: Parameters) -> FloatArray:
        """Only sum w Q log P depends on the parameters."""
        reference = self._reference(model)
        weights = self.weight * group_weights(model, self.state_action_weights) * reference
        table = np.zeros((len(parameters.vector),) * 2)
        place = parameters.place(self.block)
        theta = parameters.block(self.block)
        table[place, place] = log_transition_hessian(model, theta, weights)
        return table

    def _reference(self, model: TransitionModel) -> FloatArray:
        """(G,) Q of each distinct transition; SerdError where a row of it is no distribution."""
        if self.reference is None:
            raise SerdError("reference of KldPrior must be given here; pass local probabilities")
        return model.groups.probabilities(transitions_of(model, self.reference).entries)


def dynamics_gradient(
    model: TransitionModel, theta: FloatArray, group_gradient: FloatArray
) -> FloatArray:
    """(N,) chain a gradient by distinct transitions (G,) through to the parameters."""
    entry_gradient = group_gradient[model.groups.group_of_entry]
    return model.pull_back(theta, model.gather(entry_gradient))


def group_weights(model: TransitionModel, weights: FloatArray | None) -> FloatArray:
    """(G,) weight of the state-action pair of each distinct transition."""
    if weights is None:
        return np.ones(len(model.groups))
    checked = float_array("state_action_weights", weights, model.available.shape)
    bad = first_index(checked < 0)
    if bad is not None:
        raise SerdError(
            f"state_action_weights{list(bad)} must not be negative, got {checked[bad]}"
            "; use 0 for none"
        )
    return np.asarray(checked.ravel()[model.groups.row])


def require_dynamics_block(name: str, block: Block) -> None:
    """SerdError unless the block holds dynamics."""
    if block not in (Block.BELIEF, Block.TRUTH):
        raise SerdError(f"block of {name} must be BELIEF or TRUTH, got {block.name}")
