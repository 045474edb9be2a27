"""The log posterior of the SERD problem and its gradient (Eqs. 4.5 to 4.9).

    J(theta) = sum_D log pi_theta(a | s) + sum_D log P_T(s' | s, a) + log P(theta)

A decision whose action is hidden has log sum_a pi_theta(a | s) P_T(s' | s, a) in place of the first
two (`serd_core.posterior.hidden_actions`).

Where moves take time, P_T(s' | s, a) stands for P_T(s', t | s, a) with the dwell time t
(`serd_core.semi_markov.dwell_likelihood`).

Where several outcomes land in s', their probabilities add up; the likelihood selects none of them.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from serd_core.arrays import FloatArray, floored, weighted_counts
from serd_core.bellman.bellman_solver import (
    Adjoint,
    BellmanProblem,
    BellmanSolution,
    BellmanSolver,
    adjoint,
)
from serd_core.bellman.linear.automatic import Automatic
from serd_core.bellman.linear.linear_solver import LinearSolver
from serd_core.bellman.newton import Newton
from serd_core.demonstrations.observations import Observations
from serd_core.dynamics.transition_model import TransitionModel, Transitions, transitions_at
from serd_core.errors import SerdError
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import Problem, rewards_of, usable_features, weights_gradient
from serd_core.policies.policy_model import PolicyModel
from serd_core.posterior.hidden_actions import ExpectedCounts, expected_counts
from serd_core.posterior.parameters import Parameters
from serd_core.priors.prior import Prior


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
    solver: BellmanSolver = field(default_factory=Newton)
    linear_solver: LinearSolver = field(default_factory=Automatic)

    @cached_property
    def features(self) -> FloatArray:
        """(S, A, F) of the problem, less a large constant, which changes no policy.

        Where moves take time it does, as values of constant rewards depend on how long moves take.
        """
        if self._model.moves is not self._model:
            return self.problem.features
        features, given = self.problem.features, usable_features(self.problem)
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
        gradients = adjoint(mdp, believed, solution, by_q, self.linear_solver)
        dynamics_value, by_truth = dynamics_log_likelihood(seen, true)
        if seen.hidden:
            _, by_truth = dynamics_log_likelihood(expected.observations, true)
        log_prior = self.prior.evaluate(self._model, parameters)
        truth = self._model.moves.pull_back(parameters.truth, by_truth)
        if seen.dwells is not None:
            of_dwells, by_dwells = seen.dwells.evaluate(parameters.truth)
            dynamics_value, truth = dynamics_value + of_dwells, truth + by_dwells
        gradient = Parameters(
            reward=weights_gradient(self.features, gradients.reward_gradient),
            belief=self._model.pull_back(parameters.belief, gradients.local_gradient),
            truth=truth,
            policy=self.policy_model.parameter_gradient(parameters.policy, solution.q, counts),
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
        rewards = rewards_of(self.features, parameters.reward)
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
