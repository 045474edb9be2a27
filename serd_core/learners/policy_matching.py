"""Learners that match the policy: behavioural cloning, and policy matching under given dynamics.

Cloning is the smoothed empirical policy (section 3.1, Fig. 3.3a):

    pi(a | s) = (n(s, a) + c) / (n(s) + c |A(s)|)

Policy-matching IRL (Neu and Szepesvari; Eqs. 3.8 to 3.14) has a Boltzmann policy over optimal
Q-values with inverse temperature beta (3.11), and minimises, by one adjoint solve,

    L = 1/2 sum_{s,a} mu_E(s) (pi_theta(a|s) - pi_E(a|s))^2                               (3.8)
"""

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import LBFGS, Ascent, StepCallback
from serd_core.bellman.bellman_solver import adjoint, boltzmann
from serd_core.checks import require_positive
from serd_core.demonstrations.decisions import Decisions, require_shown
from serd_core.demonstrations.observations import observe
from serd_core.learners.fit_result import FitResult
from serd_core.learners.start import reward_search
from serd_core.mdp.problem import Problem
from serd_core.policies.solved_policy import PolicyMatchingPolicy


def clone_behaviour(
    problem: Problem, decisions: Decisions, pseudo_count: float = 1.0
) -> FloatArray:
    """Clone the demonstrated policy: (S, A) smoothed shares of the actions taken in each state.

    pseudo_count: c above 0, added to the count of every available action; states without decisions
    get a uniform policy. SerdError where actions are hidden.

        policy = sc.clone_behaviour(problem, decisions, pseudo_count=0.5)
    """
    require_positive("pseudo_count", pseudo_count)
    require_shown(decisions, "cloning")
    counts = observe(problem, decisions).state_action
    smoothed = np.where(problem.mdp.available, counts + pseudo_count, 0.0)
    return np.asarray(smoothed / smoothed.sum(axis=1, keepdims=True))


def squared_loss(policy: FloatArray, counts: FloatArray) -> tuple[float, FloatArray]:
    """Minus the loss (3.8) of a policy for (S, A) counts, and its (S, A) gradient by beta Q."""
    visits = counts.sum(axis=1, keepdims=True)
    frequency = visits / visits.sum()
    difference = policy - counts / np.maximum(visits, 1.0)
    by_policy = -frequency * difference
    mean = np.sum(policy * by_policy, axis=1, keepdims=True)
    value = -0.5 * float(np.sum(frequency * difference**2))
    return value, np.asarray(policy * (by_policy - mean))


def fit_policy_matching(
    problem: Problem,
    decisions: Decisions,
    *,
    inverse_temperature: float = 1.0,
    initial_weights: FloatArray | None = None,
    rng: np.random.Generator | None = None,
    dynamics: FloatArray | None = None,
    ascent: Ascent = LBFGS,
    on_step: StepCallback | None = None,
) -> FitResult:
    """Learn reward weights whose Boltzmann policy matches the observed choices (3.8 to 3.14).

    The squared difference of policy and choices is not convex in the weights: start more than once.

    inverse_temperature: 1 / theta_P of the policy, above 0; weights are in its units.
    initial_weights, rng, dynamics, ascent, on_step: as in `fit_mdce_irl_by_likelihood`.
    Returns a `FitResult`; raises SerdError for hidden actions and wrong arguments.

        fit = sc.fit_policy_matching(problem, decisions, rng=np.random.default_rng(0))
    """
    require_positive("inverse_temperature", inverse_temperature)
    policy_model = PolicyMatchingPolicy(1.0 / inverse_temperature)
    search = reward_search(problem, decisions, policy_model, initial_weights, rng, dynamics)

    def matching(weights: FloatArray) -> tuple[float, FloatArray]:
        solution = search.solution(weights)
        policy = boltzmann(solution.q, 1.0 / inverse_temperature)
        value, by_scaled_q = squared_loss(policy, search.observations.state_action)
        by_q = inverse_temperature * by_scaled_q
        found = adjoint(problem.mdp, search.transitions, solution, by_q)
        return value, np.tensordot(found.reward_gradient, problem.features, axes=2)

    return search.maximise(matching, ascent, on_step)
