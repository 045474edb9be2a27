"""M-estimate of the outcome models from observed transitions alone: InitialDynamicsEstimator.

With counts n(s, a, s') and a Dirichlet prior that adds c pseudo-observations to every outcome,
the estimate maximises

    sum n(s,a,s') log sum_{k leads to s'} P_m(k)  +  c sum_{m,k} log P_m(k)

At walls several outcomes lead to the same s', so expectation maximisation shares each observation
among them by their present probabilities and sets P_m(k) to its share r(k) of the model's total:

    r(k) = c + sum n(s,a,s') P_m(k) / sum_{j leads to s'} P_m(j)

The objective is concave, so that reaches its maximum from any start, but where walls hide nearly
everything only after millions of steps. A few of them come first, Newton's method does the rest
(`outcome_maximum`). A model that was never observed keeps the uniform distribution.
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray, IntArray, weighted_counts
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.observations import Observations, observe
from serd_core.dynamics.outcome_maximum import DynamicsEstimate, OutcomeCounts, maximum_of
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.errors import SerdError
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import Problem

#: Cheap steps that bring all models to where Newton's method is at its best.
SHARING_STEPS = 20


def estimate_dynamics(
    problem: Problem, decisions: Decisions, pseudo_count: float = 1.0
) -> FloatArray:
    """(M, K) outcome probabilities; SerdError where the estimate did not converge."""
    model = outcome_models_of(problem.mdp)
    estimate = most_likely_dynamics(model, observe(problem.mdp, decisions), pseudo_count)
    if not estimate.converged:
        raise SerdError(
            f"the M-estimate of the dynamics must converge, but after {estimate.steps} steps may"
            f" be off by a share of {estimate.error_bound}; pass dynamics, for example"
            f" estimate_dynamics(problem, decisions, pseudo_count={10 * max(pseudo_count, 1.0)})"
        )
    return estimate.probabilities


def most_likely_dynamics(
    model: OutcomeModels,
    observations: Observations,
    pseudo_count: float = 1.0,
    *,
    tolerance: float = 1e-9,
    max_steps: int = 200,
) -> DynamicsEstimate:
    """From the uniform distribution, by steps that share and then by Newton's, until certified."""
    if not (np.isfinite(pseudo_count) and pseudo_count > 0):
        raise SerdError(
            f"pseudo_count must be finite and above 0, got {pseudo_count}; 1 is a uniform prior"
        )
    seen = outcome_sets(model, observations)
    start = _shared(model, seen, pseudo_count)
    found = [
        maximum_of(seen.of(m, pseudo_count), start[m], tolerance, max_steps)
        for m in range(model.n_models)
    ]
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

    def of(self, model: int, pseudo_count: float) -> OutcomeCounts:
        """The part of one model."""
        mine = self.model == model
        return OutcomeCounts(self.explaining[mine], self.count[mine], pseudo_count)


def outcome_sets(model: OutcomeModels, observations: Observations) -> OutcomeSets:
    """Observations by model and set of outcomes, wherever they were made."""
    of_model, outcome = np.divmod(model.local_index[observations.entry], model.n_outcomes)
    table = np.zeros((len(observations.group), 1 + model.n_outcomes), dtype=np.int64)
    table[observations.entry_group, 0] = of_model
    table[observations.entry_group, 1 + outcome] = 1
    distinct, place = np.unique(table, axis=0, return_inverse=True)
    count = weighted_counts(place.reshape(-1), observations.group_count, len(distinct))
    return OutcomeSets(distinct[:, 0], distinct[:, 1:].astype(np.float64), count)


def _shared(model: OutcomeModels, seen: OutcomeSets, pseudo_count: float) -> FloatArray:
    """(M, K) after some steps of expectation maximisation, of all models together."""
    probabilities = np.full((model.n_models, model.n_outcomes), 1.0 / model.n_outcomes)
    for _ in range(SHARING_STEPS):
        weights = seen.explaining * probabilities[seen.model]
        shared = weights * (seen.count / weights.sum(axis=1))[:, None]
        probabilities = np.full_like(probabilities, pseudo_count)
        np.add.at(probabilities, seen.model, shared)
        probabilities /= probabilities.sum(axis=1, keepdims=True)
    return probabilities


def outcome_models_of(mdp: Mdp) -> OutcomeModels:
    """The MDP's outcome models; SerdError where it has dynamics of another kind."""
    if not isinstance(mdp.transitions, OutcomeModels):
        raise SerdError(
            "dynamics can be estimated for OutcomeModels only, got"
            f" {type(mdp.transitions).__name__}; pass its parameters as dynamics"
        )
    return mdp.transitions
