"""Gaussian prior on any block (section 4.6.2): log P = -sum (theta - mean)^2 / (2 sd^2) - Z."""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.dynamics.transition_model import TransitionModel
from serd_core.errors import SerdError
from serd_core.posterior.parameters import Block, Parameters
from serd_core.priors.prior import LogPrior, Prior


@dataclass(frozen=True)
class GaussianPrior(Prior):
    """Independent normal distributions with one mean.

    standard_deviation: one for the block, or a tuple of one per number.
    """

    standard_deviation: float | tuple[float, ...]
    block: Block
    mean: float = 0.0

    def __post_init__(self) -> None:
        given = np.atleast_1d(self.standard_deviation)
        wrong = given[~(np.isfinite(given) & (given > 0))]
        if wrong.size:
            raise SerdError(
                f"standard_deviation of GaussianPrior must be finite and above 0, got {wrong[0]}"
            )
        if not np.isfinite(self.mean):
            raise SerdError(f"mean of GaussianPrior must be finite, got {self.mean}")

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
        diagonal = np.zeros(len(parameters.vector))
        deviation = self._deviations(parameters.block(self.block))
        diagonal[parameters.place(self.block)] = -1.0 / deviation**2
        return np.diag(diagonal)

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
