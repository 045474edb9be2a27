"""All maxima of a posterior: rewards and dynamics can explain demonstrations in more than one way.

Each maximum (section 4.6.1) is approximated on its own, and weighs as its evidence:

    P(mode | D) = exp(log evidence of the mode) / sum over modes
"""

from dataclasses import dataclass

import numpy as np
import scipy.special

from serd_core.arrays import FloatArray
from serd_core.ascent.trust_region import NewtonAscent
from serd_core.bayes.laplace import (
    N_DRAWS,
    Laplace,
    PosteriorDraws,
    draws_at,
    laplace_at,
    log_posterior_of,
)
from serd_core.checks import require_count, require_generator
from serd_core.demonstrations.decisions import Decisions
from serd_core.errors import SerdError
from serd_core.learners.fit_result import FitResult
from serd_core.mdp.problem import Problem
from serd_core.posterior.coordinates import LogPosterior

#: Maxima closer than this, in standard errors of one of them, are the same.
SAME = 0.01


@dataclass(frozen=True, eq=False)
class PosteriorModes:
    """Approximations at all maxima found, those of most weight first.

    weights: (k,) that sum to 1; objective: the log posterior.
    """

    approximations: tuple[Laplace, ...]
    weights: FloatArray
    objective: LogPosterior

    @property
    def log_evidence(self) -> float:
        """log P(D), summed over the maxima."""
        each = [found.log_evidence for found in self.approximations]
        return float(scipy.special.logsumexp(each))

    def draws(self, problem: Problem, rng: np.random.Generator, n: int = N_DRAWS) -> PosteriorDraws:
        """n draws of the mixture."""
        require_count("n", n, 1, f"{N_DRAWS}")
        require_generator(rng)
        counts = rng.multinomial(n, self.weights)
        pairs = zip(self.approximations, counts, strict=True)
        points = np.concatenate([found.sample(int(count), rng) for found, count in pairs if count])
        return draws_at(problem, self.objective.coordinates, points)


def posterior_modes(
    problem: Problem,
    decisions: Decisions,
    fit: FitResult,
    rng: np.random.Generator,
    n_starts: int = 12,
) -> PosteriorModes:
    """Search from the fit, and from reward weights drawn from its prior; SerdError without one."""
    require_count("n_starts", n_starts, 1, "12")
    require_generator(rng)
    objective = log_posterior_of(problem, decisions, fit)
    first = objective.coordinates.of(fit.parameters)
    n_features = len(problem.feature_names)
    width = 1.0 / np.sqrt(np.diag(objective.prior_information(first))[:n_features])
    found: list[Laplace] = []
    for number in range(n_starts):
        start = first.copy()
        if number:
            start[:n_features] = width * rng.standard_normal(n_features)
        ascended = NewtonAscent().maximise(objective, start)
        if ascended.converged and not any(_same(one, ascended.vector) for one in found):
            found.append(laplace_at(objective, ascended.vector))
    if not found:
        raise SerdError(
            f"one of {n_starts} searches must reach a maximum, got none; give stronger priors"
        )
    found.sort(key=lambda one: -one.log_evidence)
    weights = scipy.special.softmax([one.log_evidence for one in found])
    return PosteriorModes(tuple(found), np.asarray(weights), objective)


def _same(one: Laplace, vector: FloatArray) -> bool:
    away = np.linalg.solve(one.root, vector - one.mode)
    return bool(np.linalg.norm(away) <= SAME)
