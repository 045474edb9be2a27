"""Independent normal distributions of the numbers of a block (section 4.6.2).

log P(theta) = -sum (theta - mean)^2 / (2 sd^2) - Z
"""

from dataclasses import dataclass

import numpy as np

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
        _require_deviations(self.standard_deviation)
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


def _require_deviations(given: float | tuple[float, ...]) -> None:
    """SerdError unless all are above 0, and neither too small nor too large for arithmetic."""
    name = "standard_deviation of GaussianPrior"
    for value in number_array(name, given).ravel():
        require_positive(name, value)
        if not 1.0 / _LARGEST <= value <= _LARGEST:
            raise SerdError(
                f"{name} must be from {1.0 / _LARGEST:g} to {_LARGEST:g}, got"
                f" {shown(value)}; use for example 1"
            )
