"""Policies of known rewards and dynamics, and policy models pi = g(theta_P, Q) (section 4.4).

Maximum discounted causal entropy: Boltzmann over soft Q-values (Eq. 4.13).
Policy matching: Boltzmann over optimal Q-values with a temperature (Eqs. 3.11, 4.62, 4.63).
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from serd_core.arrays import FloatArray, IntArray, largest_per_row, sum_per_row
from serd_core.bellman.bellman_solver import (
    BellmanEquation,
    BellmanProblem,
    BellmanSolution,
    HardBellman,
    Newton,
    SoftBellman,
    boltzmann,
)
from serd_core.checks import float_array, require_positive
from serd_core.display import Record
from serd_core.dynamics.transition_model import Transitions, transitions_of
from serd_core.mdp.problem import Problem, require_problem

NEWTON, SOFT = Newton(), SoftBellman()
#: Differences of values of one state that count as none, of the best and of the largest of all.
_EQUAL, _ROUNDING = 1e-9, 1e-13


@dataclass(frozen=True, eq=False, repr=False)
class Policy(Record):
    """A policy with the values it was solved from.

    value: (S,); q: (S, A), -inf where unavailable; probabilities: (S, A); greedy: (S,) best action.
    residual, error_bound, converged: certificate of the Bellman solve (`BellmanSolution`).
    """

    value: FloatArray
    q: FloatArray
    probabilities: FloatArray
    greedy: IntArray
    residual: float
    error_bound: float
    converged: bool


def soft_policy(
    problem: Problem,
    reward_weights: FloatArray,
    outcome_probabilities: FloatArray | None = None,
) -> Policy:
    """Solve for the maximum discounted causal entropy policy of known rewards (3.28 to 3.30).

    reward_weights: (F,); outcome_probabilities: (M, K) of `OutcomeModels`, None for known
    transitions. Returns value (S,), q (S, A), probabilities (S, A), greedy (S,) best actions, and
    error_bound of the values. SerdError for other shapes, or rewards that overflow.

        policy = sc.soft_policy(problem, fit.reward_weights, fit.outcome_probabilities)
    """
    solution = _solved(problem, reward_weights, outcome_probabilities, SOFT)
    return _policy(solution, solution.policy)


def optimal_policy(
    problem: Problem,
    reward_weights: FloatArray,
    outcome_probabilities: FloatArray | None = None,
) -> Policy:
    """Solve for the optimal policy of known rewards (2.24 to 2.26), even over equally good actions.

    Arguments and result as in `soft_policy`. `greedy` is the first of the best actions; values of a
    state are equal within 1e-9 of the best one, and within the rounding of all.

        print(sc.optimal_policy(problem, weights, table).greedy)
    """
    solution = _solved(problem, reward_weights, outcome_probabilities, HardBellman())
    best = solution.q.max(axis=1, keepdims=True)
    largest = np.abs(best).max()  # a value may be 0 but for rounding
    equal = solution.q >= best - _EQUAL * np.abs(best) - _ROUNDING * largest
    return _policy(solution, equal / equal.sum(axis=1, keepdims=True))


def boltzmann_policy(
    problem: Problem,
    reward_weights: FloatArray,
    outcome_probabilities: FloatArray | None,
    temperature: float,
) -> Policy:
    """Solve for the Boltzmann policy pi(a | s) ~ exp(Q*(s, a) / temperature) (4.62).

    temperature: theta_P above 0, in the units of the rewards. Others as in `soft_policy`.

        policy = sc.boltzmann_policy(problem, fit.reward_weights, fit.outcome_probabilities, 0.5)
    """
    require_positive("temperature", temperature)
    solution = _solved(problem, reward_weights, outcome_probabilities, HardBellman())
    return _policy(solution, boltzmann(solution.q, temperature))


def _solved(
    problem: Problem,
    weights: FloatArray,
    outcome_probabilities: FloatArray | None,
    equation: BellmanEquation,
) -> BellmanSolution:
    require_problem(problem)
    float_array("reward_weights", weights, (len(problem.feature_names),))
    transitions = transitions_of(problem.mdp.transitions, outcome_probabilities)
    return solution_at(problem, weights, transitions, equation)


def solution_at(
    problem: Problem,
    reward_weights: FloatArray,
    transitions: Transitions,
    equation: BellmanEquation = SOFT,
    initial_value: FloatArray | None = None,
) -> BellmanSolution:
    """The Bellman equation for (F,) weights and given transitions, from a value (S,) or zero."""
    weights = float_array("reward_weights", reward_weights, (len(problem.feature_names),))
    with np.errstate(over="ignore", invalid="ignore"):  # BellmanProblem rejects what overflows
        reward = problem.features @ weights
    return NEWTON.solve(BellmanProblem(equation, reward, transitions, problem.mdp), initial_value)


def _policy(solution: BellmanSolution, probabilities: FloatArray) -> Policy:
    return Policy(
        value=solution.value,
        q=solution.q,
        probabilities=probabilities,
        greedy=solution.q.argmax(axis=1),
        residual=solution.residual,
        error_bound=solution.error_bound,
        converged=solution.converged,
    )


class PolicyModel:
    """pi_theta(a | s) = g(theta_P, Q)(s, a); without parameters unless overridden.

    equation: the one whose Q the policy is made of.
    """

    equation: ClassVar[BellmanEquation]

    @property
    def initial_parameters(self) -> FloatArray:
        """theta_P to start from; empty where the model has none."""
        return np.zeros(0)

    def temperature(self, policy_parameters: FloatArray) -> float:
        """Temperature of the Boltzmann distribution over Q."""
        del policy_parameters
        return 1.0

    def parameter_scores(self, policy_parameters: FloatArray, q: FloatArray) -> FloatArray:
        """(S, A, p) derivative of log pi(a | s) by the p numbers of theta_P."""
        del policy_parameters
        return np.zeros((*q.shape, 0))

    def parameter_curvature(
        self, policy_parameters: FloatArray, q: FloatArray, counts: FloatArray
    ) -> tuple[FloatArray, float]:
        """(S, A) derivative of sum n(s,a) `parameter_scores` by Q, and its one by theta_P."""
        del policy_parameters, q
        return np.zeros_like(counts), 0.0

    def log_probabilities(self, policy_parameters: FloatArray, q: FloatArray) -> FloatArray:
        """(S, A) log pi(a | s); -inf where an action is unavailable."""
        scaled = q - largest_per_row(q)[:, None]
        scaled /= self.temperature(policy_parameters)
        scaled -= np.log(sum_per_row(np.exp(scaled)))[:, None]
        return scaled

    def q_gradient(
        self, policy_parameters: FloatArray, policy: FloatArray, counts: FloatArray
    ) -> FloatArray:
        """(S, A) derivative by Q of sum_sa n(s,a) log pi(a|s): (n(s,a) - n(s) pi) / temperature."""
        visits = sum_per_row(counts)
        seen = np.flatnonzero(visits)
        surprise = counts[seen] - visits[seen, None] * policy[seen]
        # `zeros` allocates pages only where they are written; `zeros_like` writes all of them.
        gradient = np.zeros(counts.shape)
        gradient[seen] = surprise / self.temperature(policy_parameters)
        return gradient


@dataclass(frozen=True)
class MdcePolicy(PolicyModel):
    """pi(a | s) = exp(Q(s, a) - V(s)) with soft Q (3.28); no parameters, temperature 1.

    The scale of the reward weights expresses how noisy the expert is.
    """

    equation = SoftBellman()


@dataclass(frozen=True)
class PolicyMatchingPolicy(PolicyModel):
    """pi(a | s) proportional to exp(Q*(s, a) / theta_P); theta_P starts at `start_temperature`."""

    equation = HardBellman()
    start_temperature: float = 1.0

    def __post_init__(self) -> None:
        require_positive("start_temperature", self.start_temperature)

    @property
    def initial_parameters(self) -> FloatArray:
        return np.array([self.start_temperature], dtype=float)

    def temperature(self, policy_parameters: FloatArray) -> float:
        """theta_P, whose powers are infinite where Python's would raise OverflowError."""
        return np.float64(policy_parameters[0])

    def parameter_scores(self, policy_parameters: FloatArray, q: FloatArray) -> FloatArray:
        """(S, A, 1) (E_pi[Q] - Q) / theta_P^2 (4.63, second case)."""
        temperature = self.temperature(policy_parameters)
        shortfall = _shortfall(boltzmann(q, temperature), q)
        return np.asarray(shortfall[:, :, None] / temperature**2)

    def parameter_curvature(
        self, policy_parameters: FloatArray, q: FloatArray, counts: FloatArray
    ) -> tuple[FloatArray, float]:
        """(S, A) and a number: derivatives of sum n (E_pi[Q] - Q) / theta_P^2."""
        temperature = self.temperature(policy_parameters)
        policy, visits = boltzmann(q, temperature), counts.sum(axis=1, keepdims=True)
        shortfall = _shortfall(policy, q)
        by_q = visits * policy * (1.0 - shortfall / temperature) - counts
        variance = np.sum(policy * shortfall**2, axis=1)
        first = float(np.sum(counts * shortfall))
        spread = float(np.sum(visits[:, 0] * variance))
        return by_q / temperature**2, -spread / temperature**4 - 2.0 * first / temperature**3


def _shortfall(policy: FloatArray, q: FloatArray) -> FloatArray:
    """(S, A) E_pi[Q] - Q, with 0 taken for Q where an action is unavailable."""
    finite_q = np.where(np.isfinite(q), q, 0.0)
    return np.asarray(np.sum(policy * finite_q, axis=1, keepdims=True) - finite_q)
