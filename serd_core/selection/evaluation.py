"""How good an estimate is (sections 4.6 and 5.2), and how usual demonstrations are for a model.

An episode's score is the mean log-likelihood of its decisions. Its rank is the share of episodes
simulated from the model, which start in the same state and take at most as many decisions, with a
lower score. The tail probability of a decision is that of all decisions in its state that are as
likely or less:

    p(s, a, s') = sum of pi(a' | s) P(s'' | s, a') over those at most pi(a | s) P(s' | s, a)

and where the action is hidden the same over the states reached, by their sums over actions.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp

from serd_core.arrays import (
    FloatArray,
    IntArray,
    first_index,
    float_array,
    number_array,
    require_index,
    weighted_counts,
)
from serd_core.demonstrations.decisions import (
    Decisions,
    require_decisions,
    require_shown,
    rows_by_trajectory,
)
from serd_core.demonstrations.observations import explaining_transitions, observe_in
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.dynamics.transition_model import transitions_of
from serd_core.errors import SerdError
from serd_core.learners.fit_result import FitResult, require_fit
from serd_core.mdp.mdp import checked_policy
from serd_core.mdp.problem import Problem, require_problem
from serd_core.policies.solved_policy import boltzmann_policy, soft_policy
from serd_core.semi_markov.models import SemiMarkovModels


def policy_log_likelihood(problem: Problem, decisions: Decisions, policy: FloatArray) -> float:
    """Compute the mean log pi(a | s) of decisions under an (S, A) policy, -inf if that is 0."""
    require_shown(decisions, "the likelihood of a policy alone")
    counts = observe_in(problem, decisions).state_action
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


#: Likelihoods that differ by less, relative to their size, count as equal.
_TIE = 1e-9


@dataclass(frozen=True, eq=False)
class EpisodeScores:
    """episode, n_decisions: (E,); log_likelihood: (E,) mean per decision; rank: (E,) from 0 to 1.

    expected: (E,) mean of the simulated scores.
    """

    episode: IntArray
    n_decisions: IntArray
    log_likelihood: FloatArray
    expected: FloatArray
    rank: FloatArray


def tail_probabilities(
    problem: Problem, decisions: Decisions, policy: FloatArray, outcome_probabilities: FloatArray
) -> FloatArray:
    """(N,) tail probability of each decision; 0 of those that the model rules out."""
    likelihood = np.exp(move_log_likelihood(problem, decisions, policy, outcome_probabilities))
    mdp = problem.mdp
    groups, chosen = mdp.transitions.groups, checked_policy("policy", policy, mdp)
    table = np.asarray(outcome_probabilities, np.float64)
    joint = chosen.ravel()[groups.row] * groups.probabilities(
        transitions_of(mdp.transitions, table).entries
    )
    state = groups.row // mdp.n_actions
    move, place = np.unique(state * mdp.n_states + groups.successor, return_inverse=True)
    by_move = weighted_counts(place.reshape(-1), joint, len(move))
    tails = np.zeros(len(decisions))
    for hidden, of, values in ((False, state, joint), (True, move // mdp.n_states, by_move)):
        first = np.searchsorted(of, np.arange(mdp.n_states + 1))  # sorted by state
        for row in np.flatnonzero(decisions.hidden == hidden):
            here = decisions.state[row]
            there = values[first[here] : first[here + 1]]
            tails[row] = there[there <= likelihood[row] * (1.0 + _TIE)].sum()
    return np.minimum(tails, 1.0)


def episode_scores(
    problem: Problem,
    decisions: Decisions,
    policy: FloatArray,
    outcome_probabilities: FloatArray,
    *,
    n_simulated: int = 200,
    rng: np.random.Generator,
) -> EpisodeScores:
    """Score and rank of every episode; simulated ones hide the actions where the episode does."""
    if n_simulated < 1:
        raise SerdError(f"n_simulated must be at least 1, got {n_simulated}; use 200")
    rows, _ = rows_by_trajectory(decisions)
    ordered = decisions.select(rows)
    likelihood = move_log_likelihood(problem, ordered, policy, outcome_probabilities)
    episodes, first, lengths = np.unique(ordered.episode, return_index=True, return_counts=True)
    score = np.add.reduceat(likelihood, first) / lengths
    expected, rank = np.empty(len(episodes)), np.empty(len(episodes))
    hidden, start = ordered.hidden[first], ordered.state[first]
    mixed = first_index(np.add.reduceat(ordered.hidden, first, dtype=int) != hidden * lengths)
    if mixed is not None:
        raise SerdError(
            "decisions of an episode must all show or all hide their actions, got both in episode"
            f" {episodes[mixed]}; hide all with with_hidden_actions"
        )
    if (final := first_index(problem.mdp.final[start])) is not None:
        raise SerdError(
            "episodes must not start in a final state, in which there is no choice, got episode"
            f" {episodes[final]} in state {start[final]}; drop it"
        )
    for state, hides in np.unique(np.stack([start, hidden], axis=1), axis=0).tolist():
        mine = np.flatnonzero((start == state) & (hidden == hides))
        sampled = sample_decisions(
            problem.mdp,
            policy,
            outcome_probabilities,
            np.eye(problem.mdp.n_states)[state],
            n_episodes=n_simulated,
            n_steps=int(lengths[mine].max()),
            rng=rng,
        )
        if hides:
            sampled = sampled.with_hidden_actions()
        of_samples = move_log_likelihood(problem, sampled, policy, outcome_probabilities)
        table = _cumulative(sampled, of_samples, n_simulated)
        for episode in mine:
            simulated = table[:, min(lengths[episode], table.shape[1]) - 1]
            expected[episode] = simulated.mean()
            rank[episode] = _rank(score[episode], simulated, rng)
    return EpisodeScores(episodes, lengths, score, expected, rank)


def _cumulative(sampled: Decisions, likelihood: FloatArray, n_simulated: int) -> FloatArray:
    """(n, T) mean log-likelihood of each simulated episode's decisions up to each step."""
    step = sampled.time_s.astype(np.int64)
    totals, counts = np.zeros((2, n_simulated, int(step.max()) + 1))
    totals[sampled.episode, step] = likelihood
    counts[sampled.episode, step] = 1.0
    return np.asarray(totals.cumsum(axis=1) / counts.cumsum(axis=1))


def _rank(score: float, simulated: FloatArray, rng: np.random.Generator) -> float:
    """Place among the simulated scores and itself, ties at random."""
    near = _TIE * max(1.0, abs(score)) if np.isfinite(score) else 0.0
    below = int(np.sum(simulated < score - near))
    equal = int(np.sum(np.abs(simulated - score) <= near))
    return (below + rng.random() * (equal + 1)) / (len(simulated) + 1)
