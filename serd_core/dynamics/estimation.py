"""M-estimate of dynamics from observed transitions alone: InitialDynamicsEstimator.

With counts n(s, a, s') and a Dirichlet prior that adds c_m(k) pseudo-observations to each outcome,
the estimate of outcome models maximises

    sum n(s,a,s') log sum_{k leads to s'} P_m(k)  +  sum_{m,k} c_m(k) log P_m(k)

At walls several outcomes lead to the same s'. A few steps of expectation maximisation share each
observation among them; Newton's method does the rest. With the relative moves x(k) = dP(k) / P(k)
of one model, q_g the shares of the outcomes that explain an observation g, and r = c + sum_g n_g
q_g, its step solves

    A x = r - t P,   A = diag c + sum_g n_g q_g q_g^T,   t such that sum_k P(k) x(k) = 0

A sum of logarithms that weigh at least m = min(1, c(1), ..., c(K)) is m times a self-concordant
one. So where the decrement d = sqrt(x^T A x / m) is below 1, every P(k) is within a share
d / (1 - d) of its most likely value (Nesterov and Nemirovskii, 1994).
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray, IntArray, weighted_counts
from serd_core.checks import require_positive
from serd_core.demonstrations.decisions import Decisions, require_shown
from serd_core.demonstrations.observations import Observations, observe
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.errors import SerdError
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import Problem
from serd_core.semi_markov.dwell_likelihood import counted_parameters
from serd_core.semi_markov.models import SemiMarkovModels

EPSILON = float(np.finfo(np.float64).eps)
#: Share of what its slope promises that a step must gain, and the shortest step tried.
ENOUGH, SHORTEST_STEP = 0.25, 1e-12
#: Share of a probability that rounding may decide before an estimate is none.
LARGEST_ROUNDING = 0.5
#: Cheap steps that bring all models to where Newton's method is at its best.
SHARING_STEPS = 20


@dataclass(frozen=True, eq=False)
class DynamicsEstimate:
    """probabilities: (M, K); Newton steps of the model that took most.

    error_bound: share of itself by which a probability may be off; converged: it is within the
    tolerance, or within what rounding allows.
    """

    probabilities: FloatArray
    steps: int
    error_bound: float
    converged: bool


@dataclass(frozen=True, eq=False)
class OutcomeCounts:
    """The objective of one model: (G, K) sets of outcomes, (G,) counts and (K,) c."""

    explaining: FloatArray
    counts: FloatArray
    pseudo_counts: FloatArray

    @property
    def total(self) -> float:
        """All observations and pseudo-observations."""
        return float(self.counts.sum() + self.pseudo_counts.sum())

    def objective(self, probabilities: FloatArray) -> float:
        """What is maximised, at (K,) positive probabilities."""
        observed = float(self.counts @ np.log(self.explaining @ probabilities))
        return observed + float(self.pseudo_counts @ np.log(probabilities))

    def newton(self, probabilities: FloatArray) -> tuple[FloatArray, float, float]:
        """(K,) relative move x, x^T A x, and the slope of the objective along x."""
        shares = self.explaining * probabilities / (self.explaining @ probabilities)[:, None]
        wanted = self.pseudo_counts + self.counts @ shares
        curvature = (shares * self.counts[:, None]).T @ shares
        curvature[np.diag_indices_from(curvature)] += self.pseudo_counts
        both = np.stack([wanted - self.total * probabilities, probabilities], axis=1)
        by_slope, by_sum = np.linalg.solve(curvature, both).T
        move = by_slope - (probabilities @ by_slope) / (probabilities @ by_sum) * by_sum
        return move, float(move @ curvature @ move), float(move @ both[:, 0])


def maximum_of(
    counts: OutcomeCounts, probabilities: FloatArray, tolerance: float, max_steps: int
) -> DynamicsEstimate:
    """Damped Newton steps from (K,) probabilities until the decrement certifies the tolerance."""
    n_outcomes, fewest = len(probabilities), float(counts.pseudo_counts.min())
    weight = min(1.0, fewest)
    # A slope is rounded to some units of the total; the curvature is at least the pseudo-count.
    least = float(np.sqrt(fewest) * np.sqrt(weight))
    rounding = (n_outcomes + 3) * EPSILON * counts.total / least
    bound = np.inf
    if rounding > LARGEST_ROUNDING:
        # The pseudo-count is lost in the counts, so hidden outcomes cannot be distinguished.
        return DynamicsEstimate(probabilities, 0, bound, converged=False)
    for step in range(1, max_steps + 1):
        move, size, slope = counts.newton(probabilities)
        decrement = float(np.sqrt(size / weight))
        # From 1/3 on, the step that follows lowers the decrement, so the bound holds after it.
        bound = decrement / (1.0 - decrement) if decrement <= 1.0 / 3.0 else np.inf
        probabilities = _moved(counts, probabilities, move, slope)
        if bound <= max(tolerance, rounding):
            return DynamicsEstimate(probabilities, step, max(bound, rounding), converged=True)
    return DynamicsEstimate(probabilities, max_steps, bound, converged=False)


def _moved(
    counts: OutcomeCounts, probabilities: FloatArray, move: FloatArray, slope: float
) -> FloatArray:
    """Probabilities after the longest of steps 1, 1/2, 1/4, ... that gains what it should."""
    before, length = counts.objective(probabilities), 1.0
    # Close to the maximum gains drown in rounding, and full steps are right.
    lost = 4.0 * EPSILON * (abs(before) + counts.total)
    while length > SHORTEST_STEP:
        there = probabilities * (1.0 + length * move)
        enough = before + ENOUGH * length * slope - lost
        if np.all(there > 0.0) and counts.objective(there) >= enough:
            return np.asarray(there / there.sum())
        length *= 0.5
    return probabilities


def estimate_dynamics(
    problem: Problem, decisions: Decisions, pseudo_count: float = 1.0
) -> FloatArray:
    """Estimate the (M, K) outcome probabilities that explain the observed moves (M-estimate).

    pseudo_count: added to each outcome of each model. Of moves that take time the result is their
    parameters. SerdError where the estimate does not converge or a move is impossible.

        table = sc.estimate_dynamics(problem, decisions)
    """
    require_shown(decisions, "the M-estimate of dynamics by counts")
    require_positive("pseudo_count", pseudo_count)
    seen = observe(problem, decisions)
    model = outcome_models_of(problem.mdp)
    outcomes = model.outcomes if isinstance(model, SemiMarkovModels) else model
    estimate = most_likely_dynamics(outcomes, seen, pseudo_count)
    if not estimate.converged:
        raise SerdError(
            f"the M-estimate of the dynamics must converge, but after {estimate.steps} steps may"
            f" be off by a share of {estimate.error_bound}; pass dynamics, for example"
            f" estimate_dynamics(problem, decisions, pseudo_count={10 * max(pseudo_count, 1.0)})"
        )
    if isinstance(model, SemiMarkovModels):
        return counted_parameters(model, estimate.probabilities, seen.dwells)
    return estimate.probabilities


def most_likely_dynamics(
    model: OutcomeModels,
    observations: Observations,
    pseudo_count: float | FloatArray = 1.0,
    *,
    tolerance: float = 1e-9,
    max_steps: int = 200,
) -> DynamicsEstimate:
    """Find the M-estimate by steps that share, and then by Newton's until it is certified.

    pseudo_count: above 0, of every outcome, or (M, K).
    """
    pseudo = np.broadcast_to(pseudo_count, model.local_shape).astype(np.float64)
    seen, found = outcome_sets(model, observations), []
    for m, start in enumerate(_shared(model, seen, pseudo)):
        mine = seen.model == m
        counts = OutcomeCounts(seen.explaining[mine], seen.count[mine], pseudo[m])
        found.append(maximum_of(counts, start, tolerance, max_steps))
    return DynamicsEstimate(
        probabilities=np.array([each.probabilities for each in found]),
        steps=max(each.steps for each in found),
        error_bound=max(each.error_bound for each in found),
        converged=all(each.converged for each in found),
    )


@dataclass(frozen=True, eq=False)
class OutcomeSets:
    """What was observed: (G,) model, (G, K) mask of outcomes that explain it, (G,) how often."""

    model: IntArray
    explaining: FloatArray
    count: FloatArray


def outcome_sets(model: OutcomeModels, observations: Observations) -> OutcomeSets:
    """Observations by model and set of outcomes, wherever they were made."""
    of_model, outcome = np.divmod(observations.local_index, model.n_outcomes)
    table = np.zeros((len(observations.key), 1 + model.n_outcomes), dtype=np.int64)
    table[observations.entry_group, 0] = of_model
    table[observations.entry_group, 1 + outcome] = 1
    distinct, place = np.unique(table, axis=0, return_inverse=True)
    count = weighted_counts(place.reshape(-1), observations.group_count, len(distinct))
    return OutcomeSets(distinct[:, 0], distinct[:, 1:].astype(np.float64), count)


def _shared(model: OutcomeModels, seen: OutcomeSets, pseudo: FloatArray) -> FloatArray:
    """(M, K) after some steps of expectation maximisation, of all models together."""
    probabilities = np.full((model.n_models, model.n_outcomes), 1.0 / model.n_outcomes)
    for _ in range(SHARING_STEPS):
        weights = seen.explaining * probabilities[seen.model]
        shared = weights * (seen.count / weights.sum(axis=1))[:, None]
        probabilities = pseudo.copy()
        np.add.at(probabilities, seen.model, shared)
        probabilities /= probabilities.sum(axis=1, keepdims=True)
    return probabilities


def outcome_models_of(mdp: Mdp) -> OutcomeModels:
    """The MDP's outcome models; SerdError where it has dynamics of another kind."""
    if not isinstance(mdp.transitions, OutcomeModels):
        raise SerdError(
            "dynamics must be OutcomeModels here, got"
            f" {type(mdp.transitions).__name__}; known transitions need no estimate"
        )
    return mdp.transitions
