"""Policies of known rewards and dynamics: solve the Bellman equation, then choose."""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray, IntArray, require_kind, require_positive
from serd_core.bellman.bellman_solver import BellmanProblem, BellmanSolution, BellmanSolver, Newton
from serd_core.bellman.equations import BellmanEquation, HardBellman, SoftBellman, boltzmann
from serd_core.dynamics.transition_model import Transitions, transitions_of
from serd_core.mdp.problem import Problem, require_problem, rewards

NEWTON, SOFT = Newton(), SoftBellman()
#: Differences of values of one state that count as none, of the best and of the largest of all.
_EQUAL, _ROUNDING = 1e-9, 1e-13


@dataclass(frozen=True, eq=False)
class Policy:
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
    solver: BellmanSolver = NEWTON,
) -> Policy:
    """Solve for the maximum discounted causal entropy policy of known rewards (3.28 to 3.30).

    reward_weights: (F,); outcome_probabilities: (M, K) of OutcomeModels, (E,) entries of a
    SparseModel, None for transitions without parameters; solver: of the Bellman equation.

    Returns a `Policy` with value (S,), q (S, A) and probabilities (S, A).

        policy = sc.soft_policy(problem, fit.reward_weights, fit.outcome_probabilities)
    """
    solution = _solved(problem, reward_weights, outcome_probabilities, SOFT, solver)
    return _policy(solution, solution.policy)


def optimal_policy(
    problem: Problem,
    reward_weights: FloatArray,
    outcome_probabilities: FloatArray | None = None,
    solver: BellmanSolver = NEWTON,
) -> Policy:
    """Solve for the optimal policy of known rewards (2.24 to 2.26), even over equally good actions.

    Arguments and result as in `soft_policy`. `greedy` is the first of the best actions; values of a
    state are equal within 1e-9 of the best one, and within the rounding of all.
    """
    solution = _solved(problem, reward_weights, outcome_probabilities, HardBellman(), solver)
    best = solution.q.max(axis=1, keepdims=True)
    largest = np.abs(best).max()  # a value may be 0 but for rounding
    equal = solution.q >= best - _EQUAL * np.abs(best) - _ROUNDING * largest
    return _policy(solution, equal / equal.sum(axis=1, keepdims=True))


def boltzmann_policy(
    problem: Problem,
    reward_weights: FloatArray,
    outcome_probabilities: FloatArray | None,
    temperature: float,
    solver: BellmanSolver = NEWTON,
) -> Policy:
    """Solve for the Boltzmann policy pi(a | s) ~ exp(Q*(s, a) / temperature) (4.62).

    temperature: theta_P above 0, in the units of the rewards. Others as in `soft_policy`.
    """
    require_positive("temperature", temperature)
    solution = _solved(problem, reward_weights, outcome_probabilities, HardBellman(), solver)
    return _policy(solution, boltzmann(solution.q, temperature))


def _solved(
    problem: Problem,
    reward_weights: FloatArray,
    outcome_probabilities: FloatArray | None,
    equation: BellmanEquation,
    solver: BellmanSolver,
) -> BellmanSolution:
    require_problem(problem)
    require_kind("solver", solver, (BellmanSolver,), "Newton()")
    with np.errstate(over="ignore", invalid="ignore"):  # BellmanProblem rejects what overflows
        reward = rewards(problem, reward_weights)
    transitions = transitions_of(problem.mdp.transitions, outcome_probabilities)
    return solver.solve(BellmanProblem(equation, reward, transitions, problem.mdp))


def solution_at(
    problem: Problem,
    reward_weights: FloatArray,
    transitions: Transitions,
    equation: BellmanEquation = SOFT,
    initial_value: FloatArray | None = None,
) -> BellmanSolution:
    """The Bellman equation for (F,) weights and given transitions, from a value (S,) or zero."""
    reward = rewards(problem, reward_weights)
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
