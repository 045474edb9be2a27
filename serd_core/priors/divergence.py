"""Priors on the transition probabilities P_g of dynamics, sum_g w_g h_g(P_g).

g = (s, a, s') runs over distinct transitions and w_g is lambda times the weight w of its pair
(s, a); the thesis has w = 1 everywhere. As a mean over the available pairs, w_g is divided by the
sum of w over them. Each prior defines h and its first two derivatives.

Close to a reference model Q (Eq. 4.91), undecided (Eqs. 4.88 to 4.90), and a belief that is similar
to the true dynamics (section 4.3):

    KldPrior       -lambda sum_{s,a} w(s,a) sum_s' Q(s'|s,a) log(Q(s'|s,a) / P_theta(s'|s,a))
    EntropyPrior    lambda sum_{s,a} w(s,a) sum_s' -P(s'|s,a) log P(s'|s,a)
    CouplingPrior  -lambda sum_{s,a,s'} P_T(s'|s,a) log(P_T(s'|s,a) / P_TE(s'|s,a))

The gradient of the first is +lambda sum Q dP/P: the sign printed in (4.92) is wrong, as the finite
difference shows. In the last both models move, so the gradient has a part for each block.
"""

from abc import abstractmethod
from dataclasses import dataclass, replace

import numpy as np

from serd_core.arrays import FloatArray, float_array, floored, require_each, require_kind
from serd_core.dynamics.transition_model import (
    TransitionModel,
    dynamics_gradient,
    transition_hessian,
    transition_jacobian,
    transition_probabilities,
    transitions_of,
)
from serd_core.errors import SerdError
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
        value, slope, _ = self.terms(model.moves, self._weights(model), probability)
        gradient = dynamics_gradient(model, theta, slope)
        return LogPrior(value, parameters.zeros().with_block(self.block, gradient))

    def hessian(self, model: TransitionModel, parameters: Parameters) -> FloatArray:
        """Second derivatives, in the part of the block."""
        theta = parameters.block(self.block)
        probability = transition_probabilities(model, theta)
        _, slope, bend = self.terms(model.moves, self._weights(model), probability)
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


def group_weights(model: TransitionModel, weights: FloatArray | None) -> FloatArray:
    """(G,) weight of the state-action pair of each distinct transition."""
    if weights is None:
        return np.ones(len(model.groups))
    checked = float_array("state_action_weights", weights, model.available.shape)
    require_each("state_action_weights", checked, checked >= 0, "not be negative", "use 0 for none")
    return np.asarray(checked.ravel()[model.groups.row])


@dataclass(frozen=True, eq=False)
class KldPrior(DynamicsPrior):
    """A prior that keeps dynamics near a reference Q, by the divergence of a block's P from it.

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


@dataclass(frozen=True, eq=False)
class EntropyPrior(DynamicsPrior):
    """A prior that favours uncertain dynamics, by the entropy of a block's transitions."""

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
            transition_jacobian(model, theta, everywhere)
            for theta in (parameters.truth, parameters.belief)
        )
        mixed = (by_truth * (weights / belief)[:, None]).T @ by_belief
        table[at_truth, at_belief], table[at_belief, at_truth] = mixed, mixed.T
        return table
