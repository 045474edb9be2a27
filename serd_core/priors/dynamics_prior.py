"""Priors on the transition probabilities P_g of one dynamics block, sum_g w_g h_g(P_g).

g = (s, a, s') runs over distinct transitions and w_g is lambda times the weight w of its pair
(s, a); the thesis has w = 1 everywhere. As a mean over the available pairs, w_g is divided by the
sum of w over them. Each prior defines h and its first two derivatives.
"""

from abc import abstractmethod

import numpy as np

from serd_core.arrays import FloatArray, float_array, floored, require_each, require_kind
from serd_core.dynamics.transition_model import TransitionModel
from serd_core.errors import SerdError
from serd_core.posterior.derivatives.transition_derivatives import transition_hessian
from serd_core.posterior.parameters import Block, Parameters
from serd_core.priors.prior import LogPrior, Prior, require_dynamics_block, require_weight


class DynamicsPrior(Prior):
    """Weighted sum over the distinct transitions of a block.

    weight: lambda; state_action_weights: (S, A) weights w; None for one everywhere.
    mean_over_pairs: divide the sum by that of w over the available pairs, so that lambda weighs as
    much on problems of every size.
    """

    weight: float
    block: Block
    state_action_weights: FloatArray | None
    mean_over_pairs: bool

    def __post_init__(self) -> None:
        name = type(self).__name__
        require_weight(f"weight of {name}", self.weight)
        require_kind(f"block of {name}", self.block, (Block,), "Block.TRUTH")
        require_dynamics_block(name, self.block)

    @abstractmethod
    def terms(
        self, model: TransitionModel, weights: FloatArray, probability: FloatArray
    ) -> tuple[float, FloatArray, FloatArray]:
        """sum_g w_g h_g and (G,) first and second derivatives of w_g h_g by P_g.

        weights: (G,) w with lambda; probability: (G,) positive P.
        """

    def evaluate(self, model: TransitionModel, parameters: Parameters) -> LogPrior:
        """Value and gradient."""
        theta = parameters.block(self.block)
        probability = transition_probabilities(model, theta)
        value, slope, _ = self.terms(model, self._weights(model), probability)
        gradient = dynamics_gradient(model, theta, slope)
        return LogPrior(value, parameters.zeros().with_block(self.block, gradient))

    def hessian(self, model: TransitionModel, parameters: Parameters) -> FloatArray:
        """Second derivatives, in the part of the block."""
        theta = parameters.block(self.block)
        probability = transition_probabilities(model, theta)
        _, slope, bend = self.terms(model, self._weights(model), probability)
        return parameters.placed(self.block, transition_hessian(model, theta, slope, bend))

    def _weights(self, model: TransitionModel) -> FloatArray:
        weights = self.weight * group_weights(model, self.state_action_weights)
        return weights / self._total(model) if self.mean_over_pairs else weights

    def _total(self, model: TransitionModel) -> float:
        """Sum of w over the available pairs; SerdError where it is 0."""
        if self.state_action_weights is None:
            return float(model.available.sum())
        total = float(np.sum(self.state_action_weights[model.available]))
        if not total > 0:
            raise SerdError(
                "state_action_weights of a mean over pairs must have a positive sum over the"
                f" available pairs, got {total}; give one pair a positive weight"
            )
        return total


def transition_probabilities(model: TransitionModel, theta: FloatArray) -> FloatArray:
    """(G,) probability of each distinct transition, with a positive floor."""
    return floored(model.groups.probabilities(model.entries(model.local_probabilities(theta))))


def dynamics_gradient(
    model: TransitionModel, theta: FloatArray, group_gradient: FloatArray
) -> FloatArray:
    """(N,) gradient by the parameters for a (G,) gradient by distinct transitions."""
    entry_gradient = group_gradient[model.groups.group_of_entry]
    return model.pull_back(theta, model.gather(entry_gradient))


def group_weights(model: TransitionModel, weights: FloatArray | None) -> FloatArray:
    """(G,) weight of the state-action pair of each distinct transition."""
    if weights is None:
        return np.ones(len(model.groups))
    checked = float_array("state_action_weights", weights, model.available.shape)
    require_each("state_action_weights", checked, checked >= 0, "not be negative", "use 0 for none")
    return np.asarray(checked.ravel()[model.groups.row])
