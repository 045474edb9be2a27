"""M-estimate of the outcome models from observed transitions alone: InitialDynamicsEstimator.

With counts n(s, a, s') and a Dirichlet prior that adds c pseudo-observations to every outcome,
the estimate maximises

    sum n(s,a,s') log sum_{k leads to s'} P_m(k)  +  c sum_{m,k} log P_m(k)

At walls several outcomes lead to the same s', so expectation maximisation shares each observation
among them by their present probabilities:

    r(k) = P_m(k) / sum_{j leads to s'} P_m(j),   P_m(k) proportional to c + sum n(s,a,s') r(k)

The objective is concave in P, so EM reaches its maximum from any start. A model that was never
observed keeps the uniform distribution.
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray, floored, weighted_counts
from serd_core.demonstrations import Decisions
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.errors import SerdError
from serd_core.likelihood.observations import Observations, observe
from serd_core.mdp import Mdp
from serd_core.problem import Problem


@dataclass(frozen=True, eq=False)
class DynamicsEstimate:
    """probabilities: (M, K); steps; change: largest move of the last step; converged."""

    probabilities: FloatArray
    steps: int
    change: float
    converged: bool


def estimate_dynamics(
    problem: Problem, decisions: Decisions, pseudo_count: float = 1.0
) -> FloatArray:
    """(M, K) outcome probabilities; SerdError where EM did not converge."""
    model = outcome_models_of(problem.mdp)
    estimate = expectation_maximisation(model, observe(problem.mdp, decisions), pseudo_count)
    if not estimate.converged:
        raise SerdError(
            f"estimate_dynamics must converge, but moved by {estimate.change} in step"
            f" {estimate.steps}; use a larger pseudo_count"
        )
    return estimate.probabilities


def expectation_maximisation(
    model: OutcomeModels,
    observations: Observations,
    pseudo_count: float = 1.0,
    *,
    tolerance: float = 1e-10,
    max_steps: int = 10_000,
) -> DynamicsEstimate:
    """Iterate E- and M-step from the uniform distribution."""
    if not (np.isfinite(pseudo_count) and pseudo_count > 0):
        raise SerdError(
            f"pseudo_count must be finite and above 0, got {pseudo_count}; 1 is a uniform prior"
        )
    shape = (model.n_models, model.n_outcomes)
    probabilities = np.full(shape, 1.0 / model.n_outcomes)
    change = np.inf
    for step in range(1, max_steps + 1):
        counts = expected_outcome_counts(model, observations, probabilities)
        updated = counts + pseudo_count
        updated /= updated.sum(axis=1, keepdims=True)
        change = float(np.max(np.abs(updated - probabilities)))
        probabilities = updated
        if change <= tolerance:
            return DynamicsEstimate(probabilities, step, change, converged=True)
    return DynamicsEstimate(probabilities, max_steps, change, converged=False)


def expected_outcome_counts(
    model: OutcomeModels, observations: Observations, probabilities: FloatArray
) -> FloatArray:
    """(M, K) E-step: observations shared among the outcomes that explain them."""
    entries = model.entries(probabilities)
    explaining = entries[observations.entry]
    total = weighted_counts(observations.entry_group, explaining, len(observations.group))
    share = observations.group_count / floored(total)
    counts = np.zeros_like(entries)
    counts[observations.entry] = explaining * share[observations.entry_group]
    return model.gather(counts)


def outcome_models_of(mdp: Mdp) -> OutcomeModels:
    """The MDP's outcome models; SerdError where it has dynamics of another kind."""
    if not isinstance(mdp.transitions, OutcomeModels):
        raise SerdError(
            "dynamics can be estimated for OutcomeModels only, got"
            f" {type(mdp.transitions).__name__}; pass initial_dynamics instead"
        )
    return mdp.transitions
