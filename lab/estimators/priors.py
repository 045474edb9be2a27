"""Priors of the thesis that its experiments use: norms of parameters, and entropy of dynamics.

    NormPrior     -lambda (sum_i |theta_i|_e^p)^(1/p),   |x|_e = sqrt(x^2 + e^2)          (4.86)
    EntropyPrior  -lambda sum_{s,a,s'} P(s'|s,a) log P(s'|s,a)                   (4.88 to 4.90)

The norm is not differentiable where an entry is 0 for p = 1 (and at the origin for every p), so
gradients need e > 0; the norm is then too large by at most n^(1/p) e. (4.87) as printed lacks the
factor lambda and writes rho for theta in its denominator.
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.checks import is_number, require_kind, require_positive, shown
from serd_core.dynamics.transition_model import (
    TransitionModel,
    dynamics_gradient,
    transition_hessian,
    transition_probabilities,
)
from serd_core.errors import SerdError
from serd_core.posterior.parameters import Block, Parameters
from serd_core.priors.prior import LogPrior, Prior, require_dynamics_block, require_weight


@dataclass(frozen=True)
class NormPrior(Prior):
    """A prior for sparse (p = 1) or small (p = 2) parameters: -weight times the smoothed p-norm."""

    weight: float
    block: Block
    p: float = 2.0
    smoothing: float = 1e-4

    def __post_init__(self) -> None:
        require_weight("weight of NormPrior", self.weight)
        require_kind("block of NormPrior", self.block, (Block,), "Block.REWARD")
        if not (is_number(self.p) and 1.0 <= self.p < np.inf):
            raise SerdError(
                f"p of NormPrior must be finite and at least 1, got {shown(self.p)}; use 2"
            )
        require_positive("smoothing of NormPrior", self.smoothing, "use for example 1e-4")

    def evaluate(self, model: TransitionModel, parameters: Parameters) -> LogPrior:
        """Value (4.86) and gradient (4.87)."""
        del model
        theta = parameters.block(self.block)
        if not theta.size:
            return LogPrior(0.0, parameters.zeros())
        absolute, norm = self._norm(theta)
        slope = theta / absolute * (absolute / norm) ** (self.p - 1.0)
        gradient = parameters.zeros().with_block(self.block, -self.weight * slope)
        return LogPrior(-self.weight * norm, gradient)

    def hessian(self, model: TransitionModel, parameters: Parameters) -> FloatArray:
        """With a = |theta|_e, its slope c = theta / a, norm n and s = dn = c (a / n)^(p-1):

        d2 n = diag(e^2 / a^3 (a / n)^(p-1)) + (p - 1) / n (diag(c^2 (a / n)^(p-2)) - s s^T)
        """
        del model
        theta = parameters.block(self.block)
        if not theta.size:
            return np.zeros((len(parameters.vector),) * 2)
        absolute, norm = self._norm(theta)
        share, slope = absolute / norm, theta / absolute
        kink = (self.smoothing / absolute) ** 2 / absolute * share ** (self.p - 1.0)
        along = slope * share ** (self.p - 1.0)
        bowl = np.diag(slope**2 * share ** (self.p - 2.0)) - np.outer(along, along)
        table = np.diag(kink) + (self.p - 1.0) / norm * bowl
        return parameters.placed(self.block, -self.weight * table)

    def _norm(self, theta: FloatArray) -> tuple[FloatArray, float]:
        """(n,) |theta|_e and its p-norm."""
        absolute = np.sqrt(theta**2 + self.smoothing**2)
        # Scaling by the largest entry keeps large powers finite.
        largest = float(absolute.max())
        relative = absolute / largest
        return absolute, largest * float(np.sum(relative**self.p)) ** (1.0 / self.p)


@dataclass(frozen=True)
class EntropyPrior(Prior):
    """A prior that favours uncertain dynamics, by the entropy of a block's transitions."""

    weight: float
    block: Block = Block.TRUTH

    def __post_init__(self) -> None:
        require_weight("weight of EntropyPrior", self.weight)
        require_dynamics_block("EntropyPrior", self.block)

    def evaluate(self, model: TransitionModel, parameters: Parameters) -> LogPrior:
        """(4.88) and its gradient (4.89)."""
        theta = parameters.block(self.block)
        probability = transition_probabilities(model, theta)
        logs = np.log(probability)
        slope = dynamics_gradient(model, theta, -self.weight * (logs + 1.0))
        gradient = parameters.zeros().with_block(self.block, slope)
        return LogPrior(-self.weight * float(np.sum(probability * logs)), gradient)

    def hessian(self, model: TransitionModel, parameters: Parameters) -> FloatArray:
        """Second derivatives, in the part of the block."""
        theta = parameters.block(self.block)
        probability = transition_probabilities(model, theta)
        slope, bend = -self.weight * (np.log(probability) + 1.0), -self.weight / probability
        return parameters.placed(self.block, transition_hessian(model, theta, slope, bend))
