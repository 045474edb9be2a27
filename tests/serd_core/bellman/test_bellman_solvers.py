import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from serd_core.bellman.bellman_solver import BellmanProblem, ValueIteration
from serd_core.bellman.equations import HardBellman, SoftBellman
from serd_core.bellman.newton import Newton
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.dynamics.transition_model import transitions_of
from serd_core.errors import SerdError
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import TabularProblem
from tests.serd_core.bellman.exact_values import exact_hard_value, exact_soft_value, largest_error

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
    n_actions = len(rewards)
    models = OutcomeModels(
        np.zeros((1, n_actions, 1), int),
        np.zeros((1, n_actions), int),
        np.ones((1, n_actions), bool),
        1,
    )
    features = np.asarray(rewards, dtype=float)[None, :, None]
    return TabularProblem(Mdp(models, discount), features, ("reward",))


@pytest.mark.parametrize("solver", [Newton(), ValueIteration()], ids=["newton", "sweeps"])
def test_one_state_has_the_value_of_the_geometric_series(solver):
    problem = one_state([1.0, 3.0], 0.9)
    soft = solver.solve(bellman(problem, np.ones((1, 1)), [1.0], SoftBellman()))
    hard = solver.solve(bellman(problem, np.ones((1, 1)), [1.0], HardBellman()))
    assert soft.value[0] == pytest.approx(np.log(np.exp(1) + np.exp(3)) / 0.1, rel=1e-9)
    assert hard.value[0] == pytest.approx(30.0, rel=1e-9)
    np.testing.assert_allclose(soft.policy[0, 1], 1 / (1 + np.exp(-2)), rtol=1e-9)


@EACH_EQUATION
@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 10_000), discount=st.sampled_from([0.0, 0.5, 0.9, 0.99]))
def test_newton_and_value_iteration_agree_within_their_error_bounds(
    equation, random_problem, seed, discount
):
    problem, probabilities = random_problem(seed, discount)
    posed = bellman(problem, probabilities, [3.0, -1.0], equation)
    fast = Newton().solve(posed)
    slow = ValueIteration().solve(posed)
    assert fast.converged
    assert slow.converged
    difference = np.max(np.abs(fast.value - slow.value))
    assert difference <= fast.error_bound + slow.error_bound
    np.testing.assert_allclose(fast.policy.sum(axis=1), 1.0)
    assert np.all(fast.policy[~problem.mdp.available] == 0)


SOLVERS = [Newton(), ValueIteration(accuracy=1e-14, max_sweeps=500), ValueIteration(max_sweeps=3)]
EACH_SOLVER = pytest.mark.parametrize("solver", SOLVERS, ids=["newton", "sweeps", "three sweeps"])


@EACH_SOLVER
@settings(deadline=None, max_examples=40)
@given(
    seed=st.integers(0, 10_000),
    discount=st.sampled_from([0.0, 0.5, 0.9, 0.999, 0.9999]),
    size=st.sampled_from([1e-3, 1.0, 1e4]),
)
def test_the_error_bound_holds_against_values_in_fractions(
    solver, random_problem, seed, discount, size
):
    problem, probabilities = random_problem(seed, discount)
    posed = bellman(problem, probabilities, [3.0 * size, -size], HardBellman())
    solution = solver.solve(posed)
    assert largest_error(solution.value, exact_hard_value(posed)) <= solution.error_bound


@EACH_SOLVER
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("discount", [0.0, 0.5, 0.9])
def test_the_error_bound_holds_against_soft_values_of_many_digits(
    solver, random_problem, seed, discount
):
    problem, probabilities = random_problem(seed, discount)
    posed = bellman(problem, probabilities, [3.0, -1.0], SoftBellman())
    solution = solver.solve(posed)
    assert largest_error(solution.value, exact_soft_value(posed)) <= solution.error_bound


def test_a_computed_residual_of_zero_certifies_no_exact_value():
    """2.739 / (1 - 0.9) is no float: a bound of zero would be a lie, however small the residual."""
    rewards = np.random.default_rng(0).uniform(-10.0, 10.0, 40)
    for reward in rewards:
        problem = one_state([reward], 0.9999)
        posed = bellman(problem, np.ones((1, 1)), [1.0], HardBellman())
        solution = Newton().solve(posed)
        error = largest_error(solution.value, exact_hard_value(posed))
        assert 0 < error <= solution.error_bound <= 1e-10 * abs(reward / (1 - 0.9999))


@EACH_EQUATION
def test_newton_needs_few_steps_where_sweeps_need_a_hundred_thousand(equation, make_gridworld):
    case = make_gridworld(side=8, discount=0.9999, n_episodes=1)
    posed = bellman(case.problem, case.probabilities, case.weights, equation)
    solution = Newton().solve(posed)
    assert solution.converged
    assert solution.steps < 40
    assert solution.error_bound <= 1e-9 * np.max(np.abs(solution.value))


def test_large_rewards_and_a_far_start_do_not_break_newton(gridworld):
    posed = bellman(gridworld.problem, gridworld.probabilities, [1e4, -1e4], SoftBellman())
    far = np.where(np.arange(25) % 2 == 0, 1e7, -1e7)
    solution = Newton().solve(posed, far)
    assert solution.converged
    assert np.all(np.isfinite(solution.value))


def test_a_warm_start_at_the_solution_needs_no_linear_solve(gridworld):
    posed = bellman(gridworld.problem, gridworld.probabilities, [1.0, 2.0], SoftBellman())
    first = Newton().solve(posed)
    again = Newton().solve(posed, first.value)
    assert again.linear_solves == 0
    assert again.converged


def test_running_out_of_steps_is_said_and_not_hidden(gridworld):
    posed = bellman(gridworld.problem, gridworld.probabilities, [1.0, 2.0], SoftBellman())
    for solver in (Newton(max_steps=2), ValueIteration(max_sweeps=2)):
        solution = solver.solve(posed)
        assert not solution.converged
        assert solution.steps == 2
        assert solution.error_bound == pytest.approx(solution.residual / 0.1)


def test_the_starting_value_must_be_finite_and_of_the_right_length(gridworld):
    posed = bellman(gridworld.problem, gridworld.probabilities, [1.0, 2.0], SoftBellman())
    with pytest.raises(SerdError, match=r"initial_value\[3\] must be finite, got nan"):
        Newton().solve(posed, np.where(np.arange(25) == 3, np.nan, 0.0))
    with pytest.raises(SerdError, match=r"initial_value must have shape \(25\), got \(3,\)"):
        Newton().solve(posed, np.zeros(3))


def test_rewards_that_are_not_finite_are_refused_with_the_place(minimum_example):
    transitions = transitions_of(minimum_example.mdp.transitions, np.full((2, 2), 0.5))
    rewards = np.array([[0.0, np.nan, np.nan], [np.nan, np.nan, 1.0]])
    with pytest.raises(
        SerdError, match=r"rewards\[0, 1\] must be finite and at most .*, got nan; use smaller"
    ):
        BellmanProblem(SoftBellman(), rewards, transitions, minimum_example.mdp)


def test_limits_that_no_solver_can_meet_are_refused():
    for make in (Newton, ValueIteration):
        with pytest.raises(SerdError, match="accuracy must not be negative or NaN, got nan"):
            make(accuracy=np.nan)
    with pytest.raises(SerdError, match="the bound of steps must be at least 1, got 0"):
        Newton(max_steps=0)
    with pytest.raises(SerdError, match="the bound of steps must be at least 1, got 0"):
        ValueIteration(max_sweeps=0)


@pytest.mark.parametrize("equation", EQUATIONS)
def test_the_policy_at_a_known_maximum_is_the_policy(equation):
    q = np.random.default_rng(0).normal(scale=100.0, size=(50, 4))
    q[::3, 1] = -np.inf
    found = equation.policy_at(q, equation.maximum(q))
    np.testing.assert_allclose(found, equation.policy(q), rtol=1e-12, atol=1e-300)
