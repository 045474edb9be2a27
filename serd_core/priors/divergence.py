"""Priors on dynamics: their divergence from other dynamics (Eq. 4.91, section 4.3), and Dirichlet.

    KldPrior        -lambda sum_{s,a} w(s,a) sum_s' Q(s'|s,a) log(Q(s'|s,a) / P_theta(s'|s,a))
    CouplingPrior   -lambda sum_{s,a,s'} P_T(s'|s,a) log(P_T(s'|s,a) / P_TE(s'|s,a))
    DirichletPrior  sum_m [ sum_k c_mk log P_m(k) - log B(c_m) ]

The gradient of the first is +lambda sum Q dP/P: the sign printed in (4.92) is wrong, as the finite
difference shows. Over energies a Dirichlet density has the exponents c, not c - 1, as the volume
element adds prod_k P(k): so its maximum under observed transitions is the M-estimate with
pseudo-counts c (MacKay, Machine Learning 33, 1998).
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import gammaln

from serd_core.arrays import FloatArray, floored, padded
from serd_core.checks import float_array, require_each, require_kind, require_positive
from serd_core.dynamics.outcome_models import OutcomeModels
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
from serd_core.priors.prior import LogPrior, Prior, require_dynamics_block, require_weight, terms_of


@dataclass(frozen=True, eq=False)
class KldPrior(Prior):
    """A prior that keeps dynamics P near others Q: -lambda sum w(s, a) Q log(Q / P) (4.91).

    weight: lambda, at least 0; reference: (M, K) outcome probabilities of Q, None for those that
    the fit starts with; block: of P, `Block.TRUTH` or `Block.BELIEF`; state_action_weights: (S, A)
    w, None for 1. It is no density, so it has no evidence.
    """

    weight: float
    reference: FloatArray | None = None
    block: Block = Block.TRUTH
    state_action_weights: FloatArray | None = None

    def __post_init__(self) -> None:
        require_weight("weight of KldPrior", self.weight)
        require_kind("block of KldPrior", self.block, (Block,), "Block.TRUTH")
        require_dynamics_block("KldPrior", self.block)

    def anchored(self, initial_local_probabilities: FloatArray) -> Prior:
        if self.reference is not None:
            return self
        return replace(self, reference=initial_local_probabilities)

    def evaluate(self, model: TransitionModel, parameters: Parameters) -> LogPrior:
        """(4.91) and its gradient; what the reference rules out does not count: 0 log 0 = 0."""
        theta = parameters.block(self.block)
        reference, weights, probability = self._terms(model.moves, theta)
        value = np.sum(weights * reference * np.log(floored(reference) / probability))
        slope = dynamics_gradient(model, theta, weights * reference / probability)
        return LogPrior(-float(value), parameters.zeros().with_block(self.block, slope))

    def hessian(self, model: TransitionModel, parameters: Parameters) -> FloatArray:
        theta = parameters.block(self.block)
        reference, weights, probability = self._terms(model.moves, theta)
        ratio = weights * reference / probability
        table = transition_hessian(model, theta, ratio, -ratio / probability)
        return parameters.placed(self.block, table)

    def _terms(
        self, model: TransitionModel, theta: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(G,) Q, lambda w and P of each distinct transition; SerdError for wrong tables."""
        if self.reference is None:
            raise SerdError("reference of KldPrior must be given here; pass local probabilities")
        reference = model.groups.probabilities(transitions_of(model, self.reference).entries)
        weights = np.full(len(reference), self.weight)
        if self.state_action_weights is not None:
            name, rule = "state_action_weights", "not be negative"
            given = float_array(name, self.state_action_weights, model.available.shape)
            require_each(name, given, given >= 0, rule, "use 0 for none")
            weights *= given.ravel()[model.groups.row]
        return reference, weights, transition_probabilities(model, theta)


@dataclass(frozen=True, eq=False)
class CouplingPrior(Prior):
    """Divergence from the true to the believed dynamics, weighted by lambda."""

    weight: float

    def __post_init__(self) -> None:
        require_weight("weight of CouplingPrior", self.weight)

    def evaluate(self, model: TransitionModel, parameters: Parameters) -> LogPrior:
        truth = transition_probabilities(model, parameters.truth)
        belief = transition_probabilities(model, parameters.belief)
        log_ratio = np.log(truth / belief)
        value = -float(np.sum(self.weight * truth * log_ratio))
        by_truth = dynamics_gradient(model, parameters.truth, -self.weight * (log_ratio + 1.0))
        by_belief = dynamics_gradient(model, parameters.belief, self.weight * truth / belief)
        zeros = parameters.zeros()
        gradient = Parameters(zeros.reward, by_belief, by_truth, zeros.policy)
        return LogPrior(value, gradient)

    def hessian(self, model: TransitionModel, parameters: Parameters) -> FloatArray:
        """Parts of each block, and the mixed part w / P_TE dP_T dP_TE^T."""
        truth = transition_probabilities(model, parameters.truth)
        belief = transition_probabilities(model, parameters.belief)
        at_truth, at_belief = parameters.place(Block.TRUTH), parameters.place(Block.BELIEF)
        table = np.zeros((len(parameters.vector),) * 2)
        slope = -self.weight * (np.log(truth / belief) + 1.0)
        table[at_truth, at_truth] = transition_hessian(
            model, parameters.truth, slope, -self.weight / truth
        )
        ratio = self.weight * truth / belief
        table[at_belief, at_belief] = transition_hessian(
            model, parameters.belief, ratio, -ratio / belief
        )
        by_truth = transition_jacobian(model, parameters.truth)
        by_belief = transition_jacobian(model, parameters.belief)
        mixed = (by_truth * (self.weight / belief)[:, None]).T @ by_belief
        table[at_truth, at_belief], table[at_belief, at_truth] = mixed, mixed.T
        return table


@dataclass(frozen=True)
class DirichletPrior(Prior):
    """A prior on outcome models: `pseudo_count` observations added to every outcome of each model.

    The log density is sum c log P over the outcomes, and a constant; block: `Block.TRUTH` or
    `Block.BELIEF`. intended_ratio: how many times as much is added to the outcome that a model
    intends; other than 1 it needs `OutcomeModels` with `intended`.

        fit = sc.fit_mdce_serd(problem, decisions, rng=rng, prior=sc.DirichletPrior(1.0))
    """

    pseudo_count: float
    block: Block = Block.TRUTH
    intended_ratio: float = 1.0

    def __post_init__(self) -> None:
        require_positive("pseudo_count of DirichletPrior", self.pseudo_count)
        require_positive("intended_ratio of DirichletPrior", self.intended_ratio)
        require_kind("block", self.block, (Block,), "Block.TRUTH")
        require_dynamics_block("DirichletPrior", self.block)

    @property
    def blocks(self) -> tuple[Block, ...]:
        return (self.block,)

    def counts(self, models: OutcomeModels) -> FloatArray:
        """(M, K) pseudo-counts c_mk; SerdError where no outcome is intended and the ratio not 1."""
        table = np.full((models.n_models, models.n_outcomes), float(self.pseudo_count))
        if self.intended_ratio != 1.0:
            if models.intended is None:
                raise SerdError(
                    "intended_ratio of DirichletPrior needs OutcomeModels with `intended`, got"
                    f" {self.intended_ratio} for models without; leave it out"
                )
            table[np.arange(models.n_models), models.intended] *= self.intended_ratio
        return table

    def evaluate(self, model: TransitionModel, parameters: Parameters) -> LogPrior:
        """Sum of c log P and its gradient, of outcome models beta (c - P sum_k c)."""
        models = require_outcome_models(model, "DirichletPrior")
        table = models.local_probabilities(parameters.block(self.block))
        counts = self.counts(models)
        gradient = models.beta * (counts - counts.sum(axis=1, keepdims=True) * table)
        return LogPrior(
            float(np.sum(counts * np.log(floored(table)))),
            parameters.zeros().with_block(
                self.block, padded(gradient.ravel(), (model.n_parameters,))
            ),
        )

    def hessian(self, model: TransitionModel, parameters: Parameters) -> FloatArray:
        """In the part of the block, of outcome models -beta dP sum_k c."""
        theta = parameters.block(self.block)
        models = require_outcome_models(model, "DirichletPrior")
        totals = np.repeat(self.counts(models).sum(axis=1), models.n_outcomes)
        slopes = -models.beta * totals[:, None] * models.local_jacobian(theta)
        table = padded(slopes, (len(theta), len(theta)))
        return parameters.placed(self.block, table)

    def log_constant(self, model: TransitionModel, parameters: Parameters) -> float:
        """Of each model the volume of the coordinates over B(c_m)."""
        del parameters
        models = require_outcome_models(model, "DirichletPrior")
        counts = self.counts(models)
        log_beta = gammaln(counts).sum(axis=1) - gammaln(counts.sum(axis=1))
        return models.n_models * log_volume(models) - float(log_beta.sum())


def pseudo_counts_of(prior: Prior, blocks: tuple[Block, ...], models: OutcomeModels) -> FloatArray:
    """(M, K) c of the Dirichlet prior on one of some blocks, 0 where they have none."""
    table = np.zeros((models.n_models, models.n_outcomes))
    for factor in terms_of(prior):
        if isinstance(factor, DirichletPrior) and factor.block in blocks:
            table += factor.counts(models)
    return table


def log_volume(models: OutcomeModels) -> float:
    """log |d(log-ratios of one model's probabilities) / d(coordinates of its energies)|."""
    size = models.n_outcomes
    return float((size - 1) * np.log(models.beta) + 0.5 * np.log(size))


def require_outcome_models(model: TransitionModel, name: str) -> OutcomeModels:
    """The models over whose energies priors are; SerdError for dynamics of another kind."""
    moves = model.moves if isinstance(model, OutcomeModels) else None
    if not isinstance(moves, OutcomeModels):
        raise SerdError(
            f"{name} is a prior of OutcomeModels, got {type(model).__name__}; pass another prior,"
            " or belief=FixedBelief() where dynamics are not learned"
        )
    return moves
