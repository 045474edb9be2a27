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
    """Independent normal distributions with one mean and standard deviation for the block."""

    standard_deviation: float
    block: Block
    mean: float = 0.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.standard_deviation) and self.standard_deviation > 0):
            raise SerdError(
                "standard_deviation of GaussianPrior must be finite and above 0, got"
                f" {self.standard_deviation}"
            )
        if not np.isfinite(self.mean):
            raise SerdError(f"mean of GaussianPrior must be finite, got {self.mean}")

    def evaluate(self, model: TransitionModel, parameters: Parameters) -> LogPrior:
        """Value and gradient."""
        del model
        away = (parameters.block(self.block) - self.mean) / self.standard_deviation
        gradient = parameters.zeros().with_block(self.block, -away / self.standard_deviation)
        return LogPrior(-0.5 * float(np.sum(away**2)), gradient)

    def hessian(self, model: TransitionModel, parameters: Parameters) -> FloatArray:
        """-1 / sd^2 on the block's diagonal."""
        del model
        diagonal = np.zeros(len(parameters.vector))
        diagonal[parameters.place(self.block)] = -1.0 / self.standard_deviation**2
        return np.diag(diagonal)
