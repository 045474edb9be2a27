"""Gaussian priors: on any block (section 4.6.2), and on what an expert believes, around the truth.

    log P(theta) = -sum (theta - mean)^2 / (2 sd^2) - Z
    log P(theta_TE | theta_T) = -beta^2 |theta_TE - theta_T|^2 / (2 sd^2) - Z

The second is over energies without gauge, so outcome distributions are logistic-normal (Aitchison
and Shen, Biometrika 67, 1980); log means and shapes of dwell times deviate alike. Its Z does not
depend on the truth, which a Dirichlet distribution around the truth would draw to even
probabilities.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from serd_core.arrays import (
    FloatArray,
    is_number,
    number_array,
    require_kind,
    require_positive,
    shown,
)
from serd_core.dynamics.transition_model import TransitionModel
from serd_core.errors import SerdError
from serd_core.posterior.parameters import Block, Parameters
from serd_core.priors.dirichlet import require_outcome_models
from serd_core.priors.prior import LogPrior, Prior

#: Largest mean, standard deviation and inverse of one, of which fourth powers are finite.
_LARGEST = 1e50


@dataclass(frozen=True)
class GaussianPrior(Prior):
    """A prior on any block: independent normal distributions with one mean.

    standard_deviation: one for the block, or a tuple of one per number.

        prior = sc.GaussianPrior(2.0, sc.Block.REWARD)
    """

    standard_deviation: float | tuple[float, ...]
    block: Block
    mean: float = 0.0

    def __post_init__(self) -> None:
        _require_deviations("GaussianPrior", self.standard_deviation)
        require_kind("block of GaussianPrior", self.block, (Block,), "Block.REWARD")
        if not (is_number(self.mean) and abs(self.mean) <= _LARGEST):
            raise SerdError(
                f"mean of GaussianPrior must be from -{_LARGEST:g} to {_LARGEST:g}, got"
                f" {shown(self.mean)}; use for example 0"
            )

    def evaluate(self, model: TransitionModel, parameters: Parameters) -> LogPrior:
        """Value and gradient."""
        del model
        theta = parameters.block(self.block)
        deviation = self._deviations(theta)
        away = (theta - self.mean) / deviation
        gradient = parameters.zeros().with_block(self.block, -away / deviation)
        return LogPrior(-0.5 * float(np.sum(away**2)), gradient)

    def hessian(self, model: TransitionModel, parameters: Parameters) -> FloatArray:
        """-1 / sd^2 on the block's diagonal."""
        del model
        deviation = self._deviations(parameters.block(self.block))
        return parameters.placed(self.block, np.diag(-1.0 / deviation**2))

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The block; SerdError where that is no vector of real numbers without gauge."""
        if self.block is not Block.REWARD:
            raise SerdError(self._improper)
        return (self.block,)

    def log_constant(self, model: TransitionModel, parameters: Parameters) -> float:
        """-sum log(sd sqrt(2 pi)) over the reward weights."""
        del model
        deviation = self._deviations(parameters.block(*self.blocks))
        return -float(np.sum(np.log(deviation) + 0.5 * np.log(2.0 * np.pi)))

    def _deviations(self, theta: FloatArray) -> FloatArray:
        """(n,) of each number; SerdError where there are as many as it has not."""
        given = np.asarray(self.standard_deviation, dtype=np.float64)
        if given.ndim and given.shape != theta.shape:
            raise SerdError(
                f"standard_deviation of GaussianPrior must have one number or {len(theta)}, one"
                f" per parameter of the block {self.block.value}, got {len(given)}"
            )
        return np.broadcast_to(given, theta.shape)


@dataclass(frozen=True)
class GaussianAroundTruth(Prior):
    """The expert's belief, whose log odds deviate from the truth's by that standard deviation."""

    standard_deviation: float

    def __post_init__(self) -> None:
        _require_deviations("GaussianAroundTruth", self.standard_deviation)

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The belief, given the truth."""
        return (Block.BELIEF,)

    def evaluate(self, model: TransitionModel, parameters: Parameters) -> LogPrior:
        """Value, and gradient by both blocks."""
        away = parameters.belief - parameters.truth
        pull = self._precision(model) @ away
        gradient = parameters.zeros().with_block(Block.TRUTH, pull)
        return LogPrior(-0.5 * float(away @ pull), gradient.with_block(Block.BELIEF, -pull))

    def hessian(self, model: TransitionModel, parameters: Parameters) -> FloatArray:
        """Parts of each block and the mixed one."""
        precision = self._precision(model)
        at_truth, at_belief = parameters.place(Block.TRUTH), parameters.place(Block.BELIEF)
        table = np.zeros((len(parameters.vector),) * 2)
        table[at_truth, at_truth] = table[at_belief, at_belief] = -precision
        table[at_truth, at_belief] = table[at_belief, at_truth] = precision
        return table

    def log_constant(self, model: TransitionModel, parameters: Parameters) -> float:
        """Log density of normal distributions of all energies without gauge."""
        del parameters
        models = require_outcome_models(model, "GaussianAroundTruth")
        width = self.standard_deviation / models.beta
        size = models.n_models * (models.n_outcomes - 1)
        of_laws = models.n_others * np.log(self.standard_deviation)
        size_of_all = size + models.n_others
        return -float(size * np.log(width) + of_laws + 0.5 * size_of_all * np.log(2.0 * np.pi))

    def _precision(self, model: TransitionModel) -> FloatArray:
        """(N, N) of energies, 0 along the gauge."""
        models = require_outcome_models(model, "GaussianAroundTruth")
        size = models.n_outcomes
        centred = np.eye(size) - 1.0 / size
        scale = (models.beta / self.standard_deviation) ** 2
        of_energies = scale * np.kron(np.eye(models.n_models), centred)
        of_laws = np.eye(models.n_others) / self.standard_deviation**2
        return np.asarray(scipy.linalg.block_diag(of_energies, of_laws))


def _require_deviations(name: str, given: float | tuple[float, ...]) -> None:
    """SerdError unless all are above 0, and neither too small nor too large for arithmetic."""
    for value in number_array(f"standard_deviation of {name}", given).ravel():
        require_positive(f"standard_deviation of {name}", value)
        if not 1.0 / _LARGEST <= value <= _LARGEST:
            raise SerdError(
                f"standard_deviation of {name} must be from {1.0 / _LARGEST:g} to {_LARGEST:g}, got"
                f" {shown(value)}; use for example 1"
            )
