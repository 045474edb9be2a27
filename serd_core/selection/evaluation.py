"""How good an estimate is (sections 4.6 and 5.2), by decisions that it may not have learned from.

A decision has log pi(a | s), and with dynamics log pi(a | s) P(s' | s, a); where its action is
hidden the sum over actions counts.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp

from serd_core.arrays import FloatArray, first_index
from serd_core.checks import float_array, number_array, require_index
from serd_core.demonstrations.decisions import Decisions, require_decisions, require_shown
from serd_core.demonstrations.observations import explaining_transitions, observe
from serd_core.dynamics.transition_model import transitions_of
from serd_core.errors import SerdError
from serd_core.learners.fit_result import FitResult, require_fit
from serd_core.mdp.mdp import checked_policy
from serd_core.mdp.problem import Problem, require_problem
from serd_core.policies.solved_policy import boltzmann_policy, soft_policy
from serd_core.semi_markov.models import SemiMarkovModels


def policy_log_likelihood(problem: Problem, decisions: Decisions, policy: FloatArray) -> float:
    """Compute the mean log pi(a | s) of decisions under an (S, A) policy, -inf if that is 0.

    SerdError where actions are hidden, or a row of the policy is no distribution.

        mean = sc.policy_log_likelihood(problem, decisions, policy.probabilities)
    """
    require_shown(decisions, "the likelihood of a policy alone")
    counts = observe(problem, decisions).state_action
    chosen = checked_policy("policy", policy, problem.mdp)
    seen = counts > 0
    if np.any(chosen[seen] <= 0):
        return -np.inf
    return float(np.sum(counts[seen] * np.log(chosen[seen])) / counts.sum())


def fitted_policy(problem: Problem, fit: FitResult) -> FloatArray:
    """Compute the (S, A) policy of a fit, in the fitted problem or one to which it is transferred.

    Boltzmann over optimal Q-values where the fit has a temperature of its own, else soft.

        policy = sc.fitted_policy(other_problem, fit)
    """
    require_problem(problem)
    require_fit(fit)
    model = problem.mdp.transitions
    believed = fit.believed_outcome_probabilities if model.n_parameters else None
    if isinstance(model, SemiMarkovModels):
        believed = model.local_probabilities(fit.parameters.belief)
    if len(fit.parameters.policy):
        return boltzmann_policy(
            problem, fit.reward_weights, believed, fit.temperature
        ).probabilities
    return soft_policy(problem, fit.reward_weights, believed).probabilities


def validation_log_likelihood(problem: Problem, decisions: Decisions, fit: FitResult) -> float:
    """Compute the mean log-likelihood of other decisions under the policy of a fit.

    That of a hidden action is log sum_a pi(a | s) P(s' | s, a), with the fit's dynamics.

        mean = sc.validation_log_likelihood(problem, decisions, fit)
    """
    policy = fitted_policy(problem, fit)
    require_decisions(decisions)
    if not decisions.hidden.any():
        return policy_log_likelihood(problem, decisions, policy)
    shown, hidden = decisions.select(~decisions.hidden), decisions.select(decisions.hidden)
    model, table = problem.mdp.transitions, fit.outcome_probabilities
    if isinstance(model, SemiMarkovModels):
        table = model.laws(fit.parameters.truth).probability
    total = move_log_likelihood(problem, hidden, policy, table).sum()
    if len(shown):
        total += len(shown) * policy_log_likelihood(problem, shown, policy)
    return float(total / len(decisions))


def move_log_likelihood(
    problem: Problem, decisions: Decisions, policy: FloatArray, outcome_probabilities: FloatArray
) -> FloatArray:
    """Compute the (N,) log-likelihood of each decision under a policy and dynamics.

    policy: (S, A); outcome_probabilities: (M, K). log pi(a | s) P(s' | s, a), and where the action
    is hidden the log of its sum over actions; -inf for what they rule out.
    """
    require_problem(problem)
    require_decisions(decisions)
    mdp = problem.mdp
    require_index("state", decisions.state, mdp.n_states, "a state")
    chosen = checked_policy("policy", policy, mdp)
    table = np.asarray(number_array("outcome_probabilities", outcome_probabilities), np.float64)
    entries = transitions_of(mdp.transitions, table).entries
    found = explaining_transitions(mdp, decisions)
    by_group = mdp.transitions.groups.probabilities(entries)
    moved = np.where(found >= 0, by_group[mdp.transitions.groups.places(found)], 0.0)
    with np.errstate(divide="ignore"):
        joint = np.log(chosen[decisions.state]) + np.log(moved)
        return np.asarray(logsumexp(joint, axis=1))


class WeightSelection(NamedTuple):
    """The weight of highest score, and (n,) scores of all weights in ascending order."""

    weight: float
    scores: FloatArray


def select_weight(
    fit: Callable[[float], FitResult], score: Callable[[FitResult], float], weights: Sequence[float]
) -> WeightSelection:
    """Fit with every weight and choose the one with the highest score (the larger of equals).

    fit: weight to fit on training data; score: fit to its validation log-likelihood. Scores include
    those of fits that did not converge.
    """
    candidates = np.sort(float_array("weights", weights, (None,)))
    if not candidates.size:
        raise SerdError("weights must hold at least one candidate, got none")
    scores = np.array([score(fit(float(weight))) for weight in candidates])
    if (bad := first_index(np.isnan(scores))) is not None:
        raise SerdError(
            f"score of weight {candidates[bad]} must be a number, got {scores[bad]};"
            " score the fit on validation data"
        )
    best = len(scores) - 1 - int(np.argmax(scores[::-1]))
    return WeightSelection(float(candidates[best]), scores)


def split_episodes(
    decisions: Decisions, validation_share: float, rng: np.random.Generator
) -> tuple[Decisions, Decisions]:
    """Training and validation decisions, split by whole episodes; both get at least one."""
    episodes = decisions.episodes
    if len(episodes) < 2:
        raise SerdError(
            f"decisions must have at least two episodes to be split, got {len(episodes)}"
        )
    if not 0.0 < validation_share < 1.0:
        raise SerdError(f"validation_share must be between 0 and 1, got {validation_share}")
    n_validation = int(np.clip(round(validation_share * len(episodes)), 1, len(episodes) - 1))
    shuffled = rng.permutation(episodes)
    return (
        decisions.select_episodes(shuffled[n_validation:]),
        decisions.select_episodes(shuffled[:n_validation]),
    )
