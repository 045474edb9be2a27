import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from serd_core.bellman.bellman_solver import BellmanProblem, Newton, ValueIteration
from serd_core.bellman.equations import HardBellman, SoftBellman
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


def test_a_computed_residual_of_zero_certifies_no_exact_value():
    """2.739 / (1 - 0.9) is no float: a bound of zero would be a lie, however small the residual."""
    rewards = np.random.default_rng(0).uniform(-10.0, 10.0, 40)
    for reward in rewards:
        problem = one_state([reward], 0.9999)
        posed = bellman(problem, np.ones((1, 1)), [1.0], HardBellman())
        solution = Newton().solve(posed)
        error = largest_error(solution.value, exact_hard_value(posed))
        assert 0 < error <= solution.error_bound <= 1e-10 * abs(reward / (1 - 0.9999))


def test_running_out_of_steps_is_said_and_not_hidden(gridworld):
    posed = bellman(gridworld.problem, gridworld.probabilities, [1.0, 2.0], SoftBellman())
    for solver in (Newton(max_steps=2), ValueIteration(max_sweeps=2)):
        solution = solver.solve(posed)
        assert not solution.converged
        assert solution.steps == 2
        assert solution.error_bound == pytest.approx(solution.residual / 0.1)


@pytest.mark.parametrize("equation", EQUATIONS)
def test_the_policy_at_a_known_maximum_is_the_policy(equation):
    q = np.random.default_rng(0).normal(scale=100.0, size=(50, 4))
    q[::3, 1] = -np.inf
    found = equation.policy_at(q, equation.maximum(q))
    np.testing.assert_allclose(found, equation.policy(q), rtol=1e-12, atol=1e-300)


@EACH_SOLVER
@pytest.mark.parametrize(("seed", "discount"), [(0, 0.0), (1, 0.5), (2, 0.9), (3, 0.9)])
def test_the_error_bound_holds_against_soft_values_of_many_digits(
    solver, random_problem, seed, discount
):
    problem, probabilities = random_problem(seed, discount)
    posed = bellman(problem, probabilities, [3.0, -1.0], SoftBellman())
    solution = solver.solve(posed)
    assert largest_error(solution.value, exact_soft_value(posed)) <= solution.error_bound


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


def posed_with(case, rewards):
    transitions = transitions_of(case.problem.mdp.transitions, case.probabilities)
    return BellmanProblem(SoftBellman(), rewards, transitions, case.problem.mdp)


ZEROS = np.zeros((25, 5))
WRONG = [
    (lambda case: Newton().solve(posed_with(case, ZEROS), np.full(25, np.nan)), "value.0. must be"),
    (lambda case: Newton().solve(posed_with(case, ZEROS), np.zeros(3)), "value must have shape"),
    (
        lambda case: posed_with(case, ZEROS * np.nan),
        "rewards.0, 0. must be finite .*, got nan; use",
    ),
    (lambda _: ValueIteration(accuracy=np.nan), "accuracy must not be negative or NaN, got nan"),
    (lambda _: Newton(accuracy=-1.0), "accuracy must not be negative or NaN, got -1.0"),
    (lambda _: Newton(max_steps=0), "the bound of steps must be at least 1, got 0"),
    (lambda _: ValueIteration(max_sweeps=0), "the bound of steps must be at least 1, got 0"),
]


@pytest.mark.parametrize(("call", "sentence"), WRONG)
def test_what_no_solver_can_take_is_refused_by_name(gridworld, call, sentence):
    with pytest.raises(SerdError, match=sentence):
        call(gridworld)
