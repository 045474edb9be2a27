"""Dirichlet priors on the outcome distributions P_m of a block, in the measure of their energies.

Symmetric, of the M-estimator's pseudo-count c:

    log P(theta) = sum_m [ c sum_k log P_m(k) - log B(c, ..., c) ]
    B(r) = prod_k Gamma(r_k) / Gamma(sum_k r_k)

Over probabilities a Dirichlet density has the exponents c - 1. Over energies it has c, as the
volume element adds prod_k P(k): so its maximum under observed transitions is the M-estimate, which
is the posterior mean where no wall hides outcomes (MacKay, Machine Learning 33, 1998).

Around the truth, for what an expert believes, with concentration kappa:

    P_TE,m ~ Dirichlet(kappa P_T,m)

Its mode over energies is the truth. A high concentration is a tied belief, a low one a free belief.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import gammaln, polygamma, psi

from serd_core.arrays import FloatArray, floored
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.dynamics.transition_model import TransitionModel
from serd_core.errors import SerdError
from serd_core.posterior.parameters import Block, Parameters
from serd_core.priors.prior import LogPrior, Prior


@dataclass(frozen=True)
class DirichletPrior(Prior):
    """`pseudo_count` added to every outcome of every model of a block."""

    pseudo_count: float
    block: Block = Block.TRUTH

    def __post_init__(self) -> None:
        _require_positive("pseudo_count of DirichletPrior", self.pseudo_count)
        if self.block not in (Block.BELIEF, Block.TRUTH):
            raise SerdError(
                f"block of DirichletPrior must be BELIEF or TRUTH, got {self.block.name}"
            )

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The block."""
        return (self.block,)

    def evaluate(self, model: TransitionModel, parameters: Parameters) -> LogPrior:
        """c sum log P and its gradient beta c (1 - K P)."""
        models = require_outcome_models(model, "DirichletPrior")
        table = models.local_probabilities(parameters.block(self.block))
        gradient = models.beta * self.pseudo_count * (1.0 - models.n_outcomes * table)
        return LogPrior(
            self.pseudo_count * float(np.sum(np.log(floored(table)))),
            parameters.zeros().with_block(self.block, gradient.ravel()),
        )

    def hessian(self, model: TransitionModel, parameters: Parameters) -> FloatArray:
        """-beta c K dP, in the part of the block."""
        models = require_outcome_models(model, "DirichletPrior")
        table, place = np.zeros((len(parameters.vector),) * 2), parameters.place(self.block)
        slope = models.local_jacobian(parameters.block(self.block))
        table[place, place] = -models.beta * self.pseudo_count * models.n_outcomes * slope
        return table

    def log_constant(self, model: TransitionModel, parameters: Parameters) -> float:
        """M times the volume of the coordinates over B(c, ..., c)."""
        del parameters
        models = require_outcome_models(model, "DirichletPrior")
        count, size = self.pseudo_count, models.n_outcomes
        log_beta = size * gammaln(count) - gammaln(size * count)
        return models.n_models * (log_volume(models) - float(log_beta))

    def pseudo_observations(
        self, model: TransitionModel, parameters: Parameters, block: Block
    ) -> FloatArray:
        """K c of the models of the block."""
        del parameters
        models = require_outcome_models(model, "DirichletPrior")
        count = self.pseudo_count * models.n_outcomes
        return np.full(models.n_models, count if block is self.block else 0.0)


@dataclass(frozen=True)
class DirichletAroundTruth(Prior):
    """The expert's belief, drawn around the true dynamics with a concentration."""

    concentration: float

    def __post_init__(self) -> None:
        _require_positive("concentration of DirichletAroundTruth", self.concentration)

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The belief, given the truth."""
        return (Block.BELIEF,)

    def evaluate(self, model: TransitionModel, parameters: Parameters) -> LogPrior:
        """sum_m -log B(kappa P_T) + kappa sum P_T log P_TE, and its gradient by both blocks."""
        models = require_outcome_models(model, "DirichletAroundTruth")
        truth, belief, counts = self._tables(models, parameters)
        logs = np.log(belief)
        value = np.sum(counts * logs - gammaln(counts)) + models.n_models * gammaln(
            self.concentration
        )
        by_truth = models.pull_back(parameters.truth, self.concentration * (logs - psi(counts)))
        by_belief = models.beta * self.concentration * (truth - belief)
        gradient = parameters.zeros().with_block(Block.TRUTH, by_truth)
        return LogPrior(float(value), gradient.with_block(Block.BELIEF, by_belief.ravel()))

    def hessian(self, model: TransitionModel, parameters: Parameters) -> FloatArray:
        """Parts of each block and the mixed one."""
        models = require_outcome_models(model, "DirichletAroundTruth")
        _, belief, counts = self._tables(models, parameters)
        at_truth, at_belief = parameters.place(Block.TRUTH), parameters.place(Block.BELIEF)
        slope = models.local_jacobian(parameters.truth)
        bend = -(self.concentration**2) * polygamma(1, counts).ravel()
        by_local = self.concentration * (np.log(belief) - psi(counts))
        table = np.zeros((len(parameters.vector),) * 2)
        table[at_truth, at_truth] = (slope.T * bend) @ slope
        table[at_truth, at_truth] += models.local_curvature(parameters.truth, by_local)
        scale = models.beta * self.concentration
        table[at_belief, at_belief] = -scale * models.local_jacobian(parameters.belief)
        table[at_belief, at_truth] = scale * slope
        table[at_truth, at_belief] = scale * slope.T
        return table

    def log_constant(self, model: TransitionModel, parameters: Parameters) -> float:
        """The volume of the coordinates; the rest depends on the truth and is in the value."""
        del parameters
        models = require_outcome_models(model, "DirichletAroundTruth")
        return models.n_models * log_volume(models)

    def pseudo_observations(
        self, model: TransitionModel, parameters: Parameters, block: Block
    ) -> FloatArray:
        """kappa of the models of the belief."""
        del parameters
        models = require_outcome_models(model, "DirichletAroundTruth")
        return np.full(models.n_models, self.concentration if block is Block.BELIEF else 0.0)

    def _tables(
        self, models: OutcomeModels, parameters: Parameters
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(M, K) truth, belief, and kappa times the truth."""
        truth = floored(models.local_probabilities(parameters.truth))
        belief = floored(models.local_probabilities(parameters.belief))
        return truth, belief, self.concentration * truth


def log_volume(models: OutcomeModels) -> float:
    """log |d(log-ratios of one model's probabilities) / d(coordinates of its energies)|.

    Energies move in an orthonormal basis of what is orthogonal to 1; for the log-ratios to one of K
    outcomes, over which a Dirichlet density has the exponents c, the determinant is
    beta^(K-1) sqrt(K).
    """
    size = models.n_outcomes
    return float((size - 1) * np.log(models.beta) + 0.5 * np.log(size))


def require_outcome_models(model: TransitionModel, name: str) -> OutcomeModels:
    """The outcome models; SerdError for dynamics of another kind."""
    if not isinstance(model, OutcomeModels):
        raise SerdError(
            f"{name} is a prior of OutcomeModels, got {type(model).__name__}; pass another prior,"
            " or belief=FixedBelief() where dynamics are not learned"
        )
    return model


def _require_positive(name: str, value: float) -> None:
    if not (np.isfinite(value) and value > 0):
        raise SerdError(f"{name} must be finite and above 0, got {value}; use for example 1")
