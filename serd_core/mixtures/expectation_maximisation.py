"""Maxima of a mixture's log posterior: expectation maximisation from several starts, then Newton.

The E step computes responsibilities, the M step fits types to units that count by these (Babes et
al., Apprenticeship learning about multiple intentions, ICML 2011). An M step is one Newton step of
that weighted MAP fit, shortened until it rises (Lange, Journal of the Royal Statistical Society B
57, 1995), so no step lowers the observed-data log posterior. EM is slow near the maximum, so the
best end is finished by Newton's method on the observed-data log posterior.

Starts partition the units: at the fit of one type the score of unit u, in standard errors of its
own, has a mean that differs between types. Partitions are drawn around units far apart from each
other in these scores (k-means++, Arthur and Vassilvitskii 2007).
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import cdist

from serd_core.arrays import FloatArray, IntArray
from serd_core.ascent.trust_region import quadratic_step
from serd_core.errors import SerdError
from serd_core.mixtures.mixture_posterior import MixtureLogPosterior
from serd_core.posterior.parameters import Parameters

#: Longest M step, in nats over the ranges of features; rise in nats at which EM ends.
RADIUS, SHORTEST, RISE = 4.0, 1e-6, 0.02
#: EM steps of every start, of which the best are continued, and most steps of these.
SHORT_RUN, LONG_RUN, N_CONTINUED = 6, 60, 2
#: Responsibility of the type that a start assigns a unit to.
CERTAINTY = 0.9
#: Information of a direction, of the largest, below which its scores are rounding.
KNOWN = 1e-9


@dataclass(frozen=True)
class EmSettings:
    """n_starts: partitions drawn; seed: of these."""

    n_starts: int = 8
    seed: int = 0

    def __post_init__(self) -> None:
        if self.n_starts < 1:
            raise SerdError(f"n_starts must be at least 1, got {self.n_starts}; use 8")


@dataclass(frozen=True, eq=False)
class EmRun:
    """vector: (D,) where it ended; trace: (n + 1,) log posterior before and after each EM step."""

    vector: FloatArray
    trace: FloatArray


def expectation_maximisation(
    objective: MixtureLogPosterior, start: FloatArray, n_steps: int = LONG_RUN
) -> EmRun:
    """EM from a vector, until the log posterior rises by less than `RISE` or out of steps."""
    vector, trace = start, [objective.evaluate(start)[0]]
    for _ in range(n_steps):
        responsibilities = objective.at(vector).responsibilities
        vector = m_step(objective, responsibilities, vector)
        trace.append(objective.evaluate(vector)[0])
        if trace[-1] - trace[-2] < RISE:
            break
    return EmRun(vector, np.array(trace))


def m_step(
    objective: MixtureLogPosterior, responsibilities: FloatArray, vector: FloatArray
) -> FloatArray:
    """One Newton step on the expected complete-data log posterior; (D,) that rose, or the same."""
    expected = objective.with_responsibilities(responsibilities)
    value, gradient = expected.evaluate(vector)
    curvatures, directions = np.linalg.eigh(-expected.hessian(vector))
    radius = RADIUS
    while radius > SHORTEST:
        reached = vector + quadratic_step(gradient, curvatures, directions, radius)
        if expected.evaluate(reached)[0] > value:
            return np.asarray(reached)
        radius /= 4.0
    return vector


def best_run(
    objective: MixtureLogPosterior, one_type: Parameters, scores: FloatArray, settings: EmSettings
) -> EmRun:
    """EM of the highest log posterior over starts; scores: (U, d) of the units, see `unit_scores`.

    one_type: the fit of one type, at which all types begin.
    """
    n_types = objective.space.n_types
    rng = np.random.default_rng([settings.seed, n_types])
    level = np.full(n_types, -np.log(n_types))
    start = objective.space.of((one_type,) * n_types, level)
    if n_types == 1:
        return expectation_maximisation(objective, start)
    runs = []
    for _ in range(settings.n_starts):
        partition = drawn_partition(scores, n_types, rng)
        uneven = (1.0 - CERTAINTY) / n_types
        responsibilities = CERTAINTY * np.eye(n_types)[partition] + uneven
        begun = m_step(objective, responsibilities, start)
        runs.append(expectation_maximisation(objective, begun, SHORT_RUN))
    runs.sort(key=lambda run: -run.trace[-1])
    ended = []
    for run in runs[:N_CONTINUED]:
        more = expectation_maximisation(objective, run.vector)
        ended.append(EmRun(more.vector, np.concatenate([run.trace, more.trace[1:]])))
    return max(ended, key=lambda run: float(run.trace[-1]))


def drawn_partition(points: FloatArray, n_parts: int, rng: np.random.Generator) -> IntArray:
    """(U,) part of each of the points (U, d): that of the nearest of k-means++ centres."""
    centres = [int(rng.integers(len(points)))]
    while len(centres) < n_parts:
        squared = cdist(points, points[centres], "sqeuclidean").min(axis=1)
        if not squared.sum() > 0:
            return rng.integers(n_parts, size=len(points))
        centres.append(int(rng.choice(len(points), p=squared / squared.sum())))
    return np.asarray(np.argmin(cdist(points, points[centres], "sqeuclidean"), axis=1))


def unit_scores(objective: MixtureLogPosterior, vector: FloatArray) -> FloatArray:
    """(U, d) scores of the units at a fit of one type, in standard errors of their own.

    Only those by what types differ in. A direction without information is left out.
    """
    space = objective.space
    if space.n_types != 1:
        raise SerdError(f"objective must have one type, got {space.n_types}; fit one type first")
    own = space.own[0]
    scores = objective.unit_scores(vector)[0][:, own]
    weight = np.asarray(objective.units.choices.sum(axis=1) + objective.units.moves.sum(axis=1))
    share = weight / weight.sum()
    values, vectors = np.linalg.eigh(-objective.hessian(vector)[np.ix_(own, own)])
    known = values > KNOWN * values[-1]
    whitened = scores @ (vectors[:, known] / np.sqrt(values[known]))
    return np.asarray(whitened / np.sqrt(share)[:, None])
