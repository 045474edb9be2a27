"""The log posterior of the SERD problem and its gradient (Eqs. 4.5 to 4.9).

    J(theta) = sum_D log pi_theta(a | s) + sum_D log P_T(s' | s, a) + log P(theta)

Where moves take time, P_T(s', t | s, a) stands for P_T(s' | s, a). Probabilities of several
outcomes that land in s' add up. Moves m(s, s') whose action is hidden add

    sum m log Z,   Z(s, s') = sum_a pi(a | s) P(s' | s, a),   q(a | s, s') = pi P / Z
    dL = sum m E_q[d log pi + d log P],   d2L = sum m E_q[d2 log pi + d2 log P] + sum m Cov_q[...]

(Fisher, Louis 1982), those of decisions with their action at the expected counts m q.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy.sparse

from serd_core.arrays import FloatArray, floored, weighted_counts
from serd_core.bellman.bellman_solver import (
    Adjoint,
    BellmanProblem,
    BellmanSolution,
    Newton,
    adjoint,
)
from serd_core.demonstrations.observations import Observations
from serd_core.dynamics.transition_model import TransitionModel, Transitions, transitions_at
from serd_core.errors import SerdError
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import Problem
from serd_core.policies.solved_policy import PolicyModel
from serd_core.posterior.parameters import Parameters
from serd_core.priors.prior import Prior


@dataclass(frozen=True, eq=False)
class ExpectedCounts:
    """Observations in which expected counts stand for hidden actions.

    observations: with `state_action` and `group_count` of shown and of hidden actions.
    share: (H,) q of each transition that explains a hidden action; log_likelihood: L.
    """

    observations: Observations
    share: FloatArray
    log_likelihood: float


def expected_counts(
    seen: Observations, log_policy: FloatArray, true: Transitions
) -> ExpectedCounts:
    """Share hidden actions for an (S, A) log policy and P."""
    hidden = seen.hidden
    if not hidden:
        return ExpectedCounts(seen, np.zeros(0), 0.0)
    row = seen.key[hidden.place] // true.model.n_states
    probability = seen.probabilities(true.local_probabilities)
    log_joint = log_policy.ravel()[row] + np.log(floored(probability[hidden.place]))
    largest = np.full(len(hidden.count), -np.inf)
    np.maximum.at(largest, hidden.move, log_joint)
    share = np.exp(log_joint - largest[hidden.move])
    total = weighted_counts(hidden.move, share, len(hidden.count))
    share /= total[hidden.move]
    completed = _completed(seen, hidden.count[hidden.move] * share)
    log_moves = largest + np.log(total)
    return ExpectedCounts(completed, share, float(hidden.count @ log_moves))


def drawn_actions(
    seen: Observations, log_policy: FloatArray, true: Transitions, rng: np.random.Generator
) -> Observations:
    """Observations with a draw of the hidden actions, for an (S, A) log policy and P."""
    share, hidden = expected_counts(seen, log_policy, true).share, seen.hidden
    n_states, n_actions = seen.state_action.shape
    action = seen.key[hidden.place] // n_states % n_actions
    shares = np.zeros((len(hidden.count), n_actions))
    shares[hidden.move, action] = share
    drawn = rng.multinomial(hidden.count.astype(np.int64), shares)
    return _completed(seen, drawn[hidden.move, action])


def _completed(seen: Observations, counts: FloatArray) -> Observations:
    """Observations with (H,) counts of the transitions that explain hidden actions."""
    place = seen.hidden.place
    by_pair = weighted_counts(
        seen.key[place] // len(seen.state_action), counts, seen.state_action.size
    )
    return replace(
        seen,
        state_action=seen.state_action + by_pair.reshape(seen.state_action.shape),
        group_count=seen.group_count + weighted_counts(place, counts, len(seen.key)),
    )


def move_scores(found: ExpectedCounts, scores: FloatArray) -> FloatArray:
    """(T, n) score of each hidden move, E_q of the (G, n) scores of the transitions `key`."""
    hidden = found.observations.hidden
    shape = len(hidden.count), len(scores)
    table = scipy.sparse.csr_array((found.share, (hidden.move, hidden.place)), shape=shape)
    return np.asarray(table @ scores)


def covariance_of_scores(found: ExpectedCounts, scores: FloatArray) -> FloatArray:
    """(n, n) sum m Cov_q of the (G, n) scores of the transitions `key`."""
    hidden = found.observations.hidden
    centred = scores[hidden.place] - move_scores(found, scores)[hidden.move]
    weights = hidden.count[hidden.move] * found.share
    return np.asarray((centred * weights[:, None]).T @ centred)


def dynamics_log_likelihood(
    observations: Observations, transitions: Transitions
) -> tuple[float, FloatArray]:
    """Value and gradient by the local probabilities of P."""
    local = transitions.local_probabilities
    probability = floored(observations.probabilities(local))
    value = float(np.sum(observations.group_count * np.log(probability)))
    ratio = observations.group_count / probability
    of_entries = ratio[observations.entry_group]
    slope = weighted_counts(observations.local_index, of_entries, local.size)
    return value, slope.reshape(local.shape)


def require_possible(observations: Observations, mdp: Mdp, local_probabilities: FloatArray) -> None:
    """SerdError naming the first observed transition of probability 0: nothing makes it likely."""
    found = observations.probabilities(local_probabilities)
    hidden = observations.hidden
    of_moves = weighted_counts(hidden.move, found[hidden.place], len(hidden.count))
    wrong = (observations.group_count > 0) & (found <= 0)
    wrong[hidden.place] |= of_moves[hidden.move] <= 0
    impossible = observations.key[wrong]
    if impossible.size:
        row, following = divmod(int(impossible[0]), mdp.n_states)
        state, action = divmod(row, mdp.n_actions)
        by = f"action {action}" if np.all(of_moves > 0) else "any action"
        raise SerdError(
            f"dynamics must explain every decision, but rule out the observed step from state"
            f" {state} by {by} to state {following}; give it"
            " a positive probability or drop such decisions"
        )


@dataclass(frozen=True, eq=False)
class PosteriorValue:
    """J in its parts, its gradient by all blocks, the solved equation and its adjoint.

    policy_log_likelihood, dynamics_log_likelihood: of decisions with their action, the second with
    their dwell times where moves take time;
    hidden_log_likelihood: of those without. expected: counts at which the gradient was taken.
    """

    policy_log_likelihood: float
    dynamics_log_likelihood: float
    hidden_log_likelihood: float
    log_prior: float
    gradient: Parameters
    solution: BellmanSolution
    adjoint: Adjoint
    expected: ExpectedCounts

    @property
    def objective(self) -> float:
        """J(theta)."""
        shown = self.policy_log_likelihood + self.dynamics_log_likelihood
        return shown + self.hidden_log_likelihood + self.log_prior


#: Offset of a feature, in ranges, from which rounding of the rewards would drown the differences.
LARGEST_OFFSET = 1e3


@dataclass(frozen=True, eq=False)
class Posterior:
    """J of one problem, one set of demonstrations and one policy model."""

    problem: Problem
    observations: Observations
    policy_model: PolicyModel
    prior: Prior
    solver: Newton = field(default_factory=Newton)

    @cached_property
    def features(self) -> FloatArray:
        """(S, A, F) of the problem, less a large constant, which changes no policy."""
        if self._model.moves is not self._model:
            return self.problem.features
        features, given = self.problem.features, self.problem.features[self.problem.mdp.available]
        middle, spread = given.mean(axis=0), np.ptp(given, axis=0)
        large = (spread > 0) & (np.abs(middle) > LARGEST_OFFSET * spread)
        return np.asarray(features - np.where(large, middle, 0.0)) if large.any() else features

    def evaluate(
        self, parameters: Parameters, initial_value: FloatArray | None = None
    ) -> PosteriorValue:
        """Lines 5 to 8 of Algorithm 1: Q, policy, Q-gradient, objective gradient."""
        believed, true, solution, log_policy = self.solved(parameters, initial_value)
        expected = expected_counts(self.observations, log_policy, true)
        seen, counts = self.observations, expected.observations.state_action
        policy_value = expected_log_policy(self.observations.state_action, log_policy)
        policy = np.exp(log_policy, out=log_policy)
        by_q = self.policy_model.q_gradient(parameters.policy, policy, counts)
        del log_policy, policy  # (S, A) tables that the linear system has no room beside
        mdp = self.problem.mdp
        gradients = adjoint(mdp, believed, solution, by_q)
        dynamics_value, by_truth = dynamics_log_likelihood(seen, true)
        if seen.hidden:
            _, by_truth = dynamics_log_likelihood(expected.observations, true)
        log_prior = self.prior.evaluate(self._model, parameters)
        truth = self._model.moves.pull_back(parameters.truth, by_truth)
        if seen.dwells is not None:
            of_dwells, by_dwells = seen.dwells.evaluate(parameters.truth)
            dynamics_value, truth = dynamics_value + of_dwells, truth + by_dwells
        scores = self.policy_model.parameter_scores(parameters.policy, solution.q)
        gradient = Parameters(
            reward=np.tensordot(gradients.reward_gradient, self.features, axes=2),
            belief=self._model.pull_back(parameters.belief, gradients.local_gradient),
            truth=truth,
            policy=np.tensordot(counts, scores, axes=2),
        )
        return PosteriorValue(
            policy_log_likelihood=policy_value,
            dynamics_log_likelihood=dynamics_value,
            hidden_log_likelihood=expected.log_likelihood,
            log_prior=log_prior.value,
            gradient=gradient + log_prior.gradient,
            solution=solution,
            adjoint=gradients,
            expected=expected,
        )

    def solved(
        self, parameters: Parameters, initial_value: FloatArray | None = None
    ) -> tuple[Transitions, Transitions, BellmanSolution, FloatArray]:
        """Lines 5 and 6: believed transitions, true moves, Bellman equation, (S, A) log policy."""
        believed = true = transitions_at(self._model, parameters.belief)
        if parameters.truth is not parameters.belief or self._model.moves is not self._model:
            true = transitions_at(self._model.moves, parameters.truth)
        rewards = self.features @ parameters.reward
        bellman = BellmanProblem(self.policy_model.equation, rewards, believed, self.problem.mdp)
        solution = self.solver.solve(bellman, initial_value)
        log_policy = self.policy_model.log_probabilities(parameters.policy, solution.q)
        return believed, true, solution, log_policy

    @property
    def _model(self) -> TransitionModel:
        return self.problem.mdp.transitions


def expected_log_policy(counts: FloatArray, log_policy: FloatArray) -> float:
    """sum n(s,a) log pi(a|s) over the pairs that were observed."""
    seen = counts > 0
    return float(np.sum(counts[seen] * log_policy[seen]))
