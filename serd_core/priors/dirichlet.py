"""Dirichlet priors on the outcome distributions P_m of a block, in the measure of their energies.

    log P(theta) = sum_m [ c sum_k log P_m(k) - log B(c, ..., c) ]

Over energies a Dirichlet density has the exponents c, not c - 1, as the volume element adds
prod_k P(k): so its maximum under observed transitions is the M-estimate with pseudo-count c
(MacKay, Machine Learning 33, 1998). For a SparseModel c log P(s' | s, a) is summed over the
distinct transitions.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import gammaln

from serd_core.arrays import FloatArray, floored, padded, require_kind, require_positive
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.dynamics.sparse_model import SparseModel
from serd_core.dynamics.transition_model import (
    TransitionModel,
    dynamics_gradient,
    log_transition_hessian,
    transition_probabilities,
)
from serd_core.errors import SerdError
from serd_core.posterior.parameters import Block, Parameters
from serd_core.priors.prior import LogPrior, Prior, require_dynamics_block, terms_of


@dataclass(frozen=True)
class DirichletPrior(Prior):
    """A prior on dynamics: `pseudo_count` added to every outcome of every model of a block.

    Of a SparseModel it is added to every transition.
    """

    pseudo_count: float
    block: Block = Block.TRUTH

    def __post_init__(self) -> None:
        require_positive("pseudo_count of DirichletPrior", self.pseudo_count)
        require_kind("block", self.block, (Block,), "Block.TRUTH")
        require_dynamics_block("DirichletPrior", self.block)

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The block."""
        return (self.block,)

    def evaluate(self, model: TransitionModel, parameters: Parameters) -> LogPrior:
        """c sum log P and its gradient, of outcome models beta c (1 - K P)."""
        if isinstance(model, SparseModel):
            theta = parameters.block(self.block)
            probability = transition_probabilities(model, theta)
            counts = np.full(len(model.groups), self.pseudo_count)
            slope = dynamics_gradient(model, theta, counts / probability)
            value = float(counts @ np.log(probability))
            return LogPrior(value, parameters.zeros().with_block(self.block, slope))
        models = require_outcome_models(model, "DirichletPrior")
        table = models.local_probabilities(parameters.block(self.block))
        gradient = models.beta * self.pseudo_count * (1.0 - models.n_outcomes * table)
        return LogPrior(
            self.pseudo_count * float(np.sum(np.log(floored(table)))),
            parameters.zeros().with_block(
                self.block, padded(gradient.ravel(), (model.n_parameters,))
            ),
        )

    def hessian(self, model: TransitionModel, parameters: Parameters) -> FloatArray:
        """In the part of the block, of outcome models -beta c K dP."""
        theta = parameters.block(self.block)
        if isinstance(model, SparseModel):
            counts = np.full(len(model.groups), self.pseudo_count)
            table = log_transition_hessian(model, theta, counts)
            return parameters.placed(self.block, table)
        models = require_outcome_models(model, "DirichletPrior")
        scale = -models.beta * self.pseudo_count * models.n_outcomes
        table = padded(scale * models.local_jacobian(theta), (len(theta), len(theta)))
        return parameters.placed(self.block, table)

    def log_constant(self, model: TransitionModel, parameters: Parameters) -> float:
        """M times the volume of the coordinates over B(c, ..., c)."""
        del parameters
        models = require_outcome_models(model, "DirichletPrior")
        count, size = self.pseudo_count, models.n_outcomes
        log_beta = size * gammaln(count) - gammaln(size * count)
        return models.n_models * (log_volume(models) - float(log_beta))


def pseudo_count_of(prior: Prior, blocks: tuple[Block, ...]) -> float:
    """c of the Dirichlet prior on one of some blocks, 0 where they have none."""
    factors = [each for each in terms_of(prior) if isinstance(each, DirichletPrior)]
    return sum(each.pseudo_count for each in factors if each.block in blocks)


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
