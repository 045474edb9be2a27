from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from serd_core.bellman.bellman_solver import (
    BellmanProblem,
    HardBellman,
    Newton,
    SoftBellman,
    backup,
)
from serd_core.dynamics.transition_model import transitions_of
from serd_core.mdp.problem import from_transitions
from serd_core.policies.solved_policy import optimal_policy

EQUATIONS = [SoftBellman(), HardBellman()]
EACH_EQUATION = pytest.mark.parametrize("equation", EQUATIONS, ids=["soft", "hard"])


def bellman(problem, probabilities, weights, equation):
    return BellmanProblem(
        equation=equation,
        rewards=problem.features @ np.asarray(weights),
        transitions=transitions_of(problem.mdp.transitions, probabilities),
        mdp=problem.mdp,
    )


def one_state(rewards, discount):
    features = np.array(rewards)[None, :, None]
    return from_transitions(np.ones((1, len(rewards), 1)), features, discount=discount)


def test_one_state_has_the_value_of_the_geometric_series():
    problem = one_state([1.0, 3.0], 0.9)
    soft = Newton().solve(bellman(problem, None, [1.0], SoftBellman()))
    hard = Newton().solve(bellman(problem, None, [1.0], HardBellman()))
    assert soft.value[0] == pytest.approx(np.log(np.exp(1) + np.exp(3)) / 0.1, rel=1e-9)
    assert hard.value[0] == pytest.approx(30.0, rel=1e-9)
    np.testing.assert_allclose(soft.policy[0, 1], 1 / (1 + np.exp(-2)), rtol=1e-9)


@EACH_EQUATION
@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 10_000), discount=st.sampled_from([0.0, 0.5, 0.9, 0.99]))
def test_newton_agrees_with_plain_sweeps_within_its_error_bound(
    equation, random_problem, seed, discount
):
    problem, probabilities = random_problem(seed, discount)
    posed = bellman(problem, probabilities, [3.0, -1.0], equation)
    fast, swept = Newton().solve(posed), np.zeros(problem.mdp.n_states)
    for _ in range(4000 if discount > 0.9 else 400):
        swept = backup(posed, swept).target
    assert fast.converged
    rounding = 1e-14 * max(1.0, np.abs(swept).max()) / (1.0 - discount)
    assert np.max(np.abs(fast.value - swept)) <= fast.error_bound + rounding
    np.testing.assert_allclose(fast.policy.sum(axis=1), 1.0)
    assert np.all(fast.policy[~problem.mdp.available] == 0)


def test_a_computed_residual_of_zero_certifies_no_exact_value():
    """Against fractions: 2.739 / (1 - 0.9) is no float, so a bound of zero would be wrong."""
    rewards = np.random.default_rng(0).uniform(-10.0, 10.0, 40)
    for reward in rewards:
        problem = one_state([reward], 0.9999)
        posed = bellman(problem, None, [1.0], HardBellman())
        solution = Newton().solve(posed)
        exact = Fraction(reward) / (1 - Fraction(0.9999))
        error = abs(Fraction(solution.value[0]) - exact)
        assert 0 < error <= solution.error_bound <= 1e-10 * abs(reward / (1 - 0.9999))


def test_running_out_of_steps_is_said_and_not_hidden(gridworld):
    posed = bellman(gridworld.problem, gridworld.probabilities, [1.0, 2.0], SoftBellman())
    solution = Newton(max_steps=2).solve(posed)
    assert not solution.converged
    assert solution.steps == 2
    assert solution.error_bound == pytest.approx(solution.residual / 0.1)


@EACH_EQUATION
def test_newton_needs_few_steps_from_anywhere_and_none_from_the_solution(equation, make_gridworld):
    """Sweeps need a hundred thousand."""
    case = make_gridworld(side=8, discount=0.9999, n_episodes=1)
    far = np.where(np.arange(64) % 2 == 0, 1e7, -1e7)
    for weights, start in ((case.weights, None), ([1e4, -1e4], far)):
        posed = bellman(case.problem, case.probabilities, weights, equation)
        solution = Newton().solve(posed, start)
        assert solution.converged
        assert solution.steps < 40
        assert solution.error_bound <= 1e-9 * np.max(np.abs(solution.value))
        assert Newton().solve(posed, solution.value).linear_solves == 0


def test_actions_of_value_0_are_as_good_as_each_other_but_for_rounding():
    """Left and right of the middle cell lead to rewards that cancel the cost of the way there."""
    n = 5
    ways = np.zeros((n, 2, n))
    for state in range(n):
        for action, following in enumerate((max(state - 1, 0), min(state + 1, n - 1))):
            ways[state, action, following] = 1.0
    problem = from_transitions(ways, np.eye(n)[[0, 1, 2, 1, 0]][:, :3], discount=0.9)
    # V(middle) = w2 + .9 w1 + .81 w0 / .1, as actions stay at the ends.
    weights = np.array([1.0, 0.5, -(0.45 + 8.1)])
    found = optimal_policy(problem, weights)
    assert abs(found.value[2]) < 1e-12
    np.testing.assert_array_equal(found.probabilities[2], [0.5, 0.5])
