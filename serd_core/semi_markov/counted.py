"""Dwell times by counting: the most likely laws under their prior, whatever anybody chose.

This is the first of two steps (durations counted, rewards learned under them), and where a fit of
both at once starts. Laws of moves that nobody made keep their prior mean.
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import Objective
from serd_core.ascent.trust_region import NewtonAscent
from serd_core.errors import SerdError
from serd_core.semi_markov.dwell_likelihood import DwellObservations
from serd_core.semi_markov.dwell_prior import DwellPrior
from serd_core.semi_markov.models import SemiMarkovModels

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
        """Value and (2D,) gradient."""
        theta = np.concatenate([self.energies, vector])
        away = theta - self.prior.mean(self.model)
        pull = self.prior.precision(self.model) @ away
        value, slope = self.dwells.evaluate(theta)
        return value - 0.5 * float(away @ pull), (slope - pull)[len(self.energies) :]

    def hessian(self, vector: FloatArray) -> FloatArray:
        """(2D, 2D) second derivatives."""
        bend = self.dwells.hessian(np.concatenate([self.energies, vector]))
        laws = slice(len(self.energies), None)
        return (bend - self.prior.precision(self.model))[laws, laws]


def counted_parameters(
    model: SemiMarkovModels,
    outcome_probabilities: FloatArray,
    dwells: DwellObservations | None,
    prior: DwellPrior = PRIOR,
) -> FloatArray:
    """(N,) parameters with given (M, K) probabilities and the most likely laws of dwell times.

    SerdError where the search for these does not converge.
    """
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
