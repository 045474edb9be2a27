"""Prior of dwell times: normal log means around a common one that is learned, and log shapes.

    log mean_d ~ Normal(l, sd^2),   l ~ Normal(0, WIDE^2),   log shape_d ~ Normal(log 4, 1)

Means are in seconds, so l is that of one second, give or take a factor of 20. It is integrated out:
the log means have the covariance C = sd^2 I + WIDE^2 1 1^T. A narrow sd bends the durations of
moves that nobody makes to those of the others, so the median of its hyperprior is 1.

`counted_parameters` has the most likely laws under this prior, whatever anybody chose: the first of
two steps (durations counted, rewards learned under them), and where a fit of both at once starts.
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray, require_kind, require_positive
from serd_core.ascent.ascent import Objective
from serd_core.ascent.trust_region import NewtonAscent
from serd_core.dynamics.transition_model import TransitionModel
from serd_core.errors import SerdError
from serd_core.posterior.parameters import Block, Parameters
from serd_core.priors.prior import LogPrior, Prior, require_dynamics_block
from serd_core.semi_markov.dwell_likelihood import DwellObservations
from serd_core.semi_markov.models import SemiMarkovModels, require_timed

#: Standard deviation of the common log mean; median shape and sd of its logarithm.
WIDE, MEDIAN_SHAPE, SHAPE_DEVIATION = 3.0, 4.0, 1.0


@dataclass(frozen=True)
class DwellPrior(Prior):
    """That density; deviation: sd of log means around their common one. The energies have none.

    It completes the prior of a block, usually a DirichletPrior, and claims none by itself.
    """

    deviation: float
    block: Block = Block.TRUTH

    def __post_init__(self) -> None:
        require_positive("deviation of DwellPrior", self.deviation)
        require_kind("block", self.block, (Block,), "Block.TRUTH")
        require_dynamics_block("DwellPrior", self.block)

    @property
    def blocks(self) -> tuple[Block, ...]:
        return ()

    def evaluate(self, model: TransitionModel, parameters: Parameters) -> LogPrior:
        timed = require_timed(model)
        away, pull = parameters.block(self.block) - self.mean(timed), np.zeros(timed.n_parameters)
        means, shapes = away[timed.means], away[timed.shapes]
        pull[timed.means] = (means - self._shared(timed) * means.sum()) / self.deviation**2
        pull[timed.shapes] = shapes / SHAPE_DEVIATION**2
        return LogPrior(-0.5 * float(away @ pull), parameters.zeros().with_block(self.block, -pull))

    def hessian(self, model: TransitionModel, parameters: Parameters) -> FloatArray:
        return parameters.placed(self.block, -self.precision(require_timed(model)))

    def log_constant(self, model: TransitionModel, parameters: Parameters) -> float:
        del parameters
        n, variance = require_timed(model).n_laws, self.deviation**2
        log_det = (n - 1) * np.log(variance) + np.log(variance + n * WIDE**2)
        log_det += 2.0 * n * np.log(SHAPE_DEVIATION)
        return -0.5 * float(log_det) - n * float(np.log(2.0 * np.pi))

    def mean(self, model: SemiMarkovModels) -> FloatArray:
        """(N,) prior mean of log means and log shapes; 0 for energies."""
        found = np.zeros(model.n_parameters)
        found[model.shapes] = np.log(MEDIAN_SHAPE)
        return found

    def precision(self, model: SemiMarkovModels) -> FloatArray:
        """(N, N) inverse covariance, 0 for energies; of log means by Sherman and Morrison."""
        table, identity = np.zeros((model.n_parameters,) * 2), np.eye(model.n_laws)
        table[model.means, model.means] = (identity - self._shared(model)) / self.deviation**2
        table[model.shapes, model.shapes] = identity / SHAPE_DEVIATION**2
        return table

    def _shared(self, model: SemiMarkovModels) -> float:
        """What each log mean has of the sum of all, in units of the precision of one."""
        return WIDE**2 / (self.deviation**2 + model.n_laws * WIDE**2)


#: With the usual deviation of log means around their common one.
PRIOR = DwellPrior(1.0)


@dataclass(frozen=True, eq=False)
class _LawPosterior(Objective):
    """The log posterior of laws by their (2D,) numbers, under (M*K,) energies."""

    model: SemiMarkovModels
    dwells: DwellObservations
    energies: FloatArray
    prior: DwellPrior

    def evaluate(self, vector: FloatArray) -> tuple[float, FloatArray]:
        theta = np.concatenate([self.energies, vector])
        away = theta - self.prior.mean(self.model)
        pull = self.prior.precision(self.model) @ away
        value, slope = self.dwells.evaluate(theta)
        return value - 0.5 * float(away @ pull), (slope - pull)[len(self.energies) :]

    def hessian(self, vector: FloatArray) -> FloatArray:
        bend = self.dwells.hessian(np.concatenate([self.energies, vector]))
        laws = slice(len(self.energies), None)
        return (bend - self.prior.precision(self.model))[laws, laws]


def counted_parameters(
    model: SemiMarkovModels,
    outcome_probabilities: FloatArray,
    dwells: DwellObservations | None,
    prior: DwellPrior = PRIOR,
) -> FloatArray:
    """(N,) parameters with given (M, K) probabilities and the most likely laws of dwell times."""
    start = model.outcomes.parameters_of(outcome_probabilities)
    energies = start[: model.means.start]
    start = np.concatenate([energies, prior.mean(model)[len(energies) :]])
    if dwells is None or not len(dwells.row):
        return start
    start[model.means] = float(np.mean(dwells.log_dwell))
    posterior = _LawPosterior(model, dwells, energies, prior)
    found = NewtonAscent().maximise(posterior, start[len(energies) :])
    if not found.converged:
        raise SerdError(
            f"the laws of dwell times must converge, but after {found.n_steps} steps got"
            f" {found.message!r}; pass dynamics (`SemiMarkovModels.parameters_from`)"
        )
    return np.concatenate([energies, found.vector])
