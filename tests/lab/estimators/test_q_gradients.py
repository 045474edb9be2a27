import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lab.estimators.forward_gradients import (
    entry_jacobian,
    immediate_gradient,
    q_gradient_by_iteration,
    q_gradient_by_lu,
)
from serd_core.bellman.bellman_solver import (
    BellmanProblem,
    HardBellman,
    Newton,
    SoftBellman,
    adjoint,
)
from serd_core.dynamics.transition_model import transitions_at

EACH_EQUATION = pytest.mark.parametrize("equation", [SoftBellman(), HardBellman()], ids=repr)


def solved(problem, weights, theta, equation):
    transitions = transitions_at(problem.mdp.transitions, theta)
    posed = BellmanProblem(
        equation,
        problem.features @ weights,
        transitions,
        problem.mdp,
    )
    return transitions, Newton().solve(posed)


def forward(problem, weights, theta, equation, method):
    transitions, solution = solved(problem, weights, theta, equation)
    jacobian = entry_jacobian(problem.mdp, theta)
    immediate = immediate_gradient(problem.mdp, problem.features, solution.value, jacobian)
    return method(problem.mdp, transitions, solution.policy, immediate)


@EACH_EQUATION
@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 10_000))
def test_the_adjoint_is_the_transpose_of_the_forward_gradient(equation, random_problem, seed):
    problem, table = random_problem(seed)
    mdp = problem.mdp
    theta, weights = mdp.transitions.parameters_of(table), np.array([2.0, -1.0])
    by_q = np.random.default_rng(seed).normal(size=mdp.available.shape) * mdp.available
    direct = forward(problem, weights, theta, equation, q_gradient_by_lu)
    expected = np.tensordot(by_q, direct.values, axes=2)
    transitions, solution = solved(problem, weights, theta, equation)
    found = adjoint(mdp, transitions, solution, by_q)
    by_reward = np.tensordot(found.reward_gradient * mdp.available, problem.features, axes=2)
    by_theta = mdp.transitions.pull_back(theta, found.local_gradient)
    np.testing.assert_allclose(np.concatenate([by_reward, by_theta]), expected, atol=1e-7)


@EACH_EQUATION
@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 10_000))
def test_the_forward_gradient_by_iteration_and_by_lu_is_the_finite_difference_of_q(
    equation, random_problem, seed
):
    problem, table = random_problem(seed)
    theta, weights = problem.mdp.transitions.parameters_of(table), np.array([2.0, -1.0])
    direct = forward(problem, weights, theta, equation, q_gradient_by_lu).values
    swept = forward(problem, weights, theta, equation, q_gradient_by_iteration)
    assert swept.converged
    np.testing.assert_allclose(swept.values, direct, atol=1e-7)
    allowed = problem.mdp.available

    def q_at(vector):
        return solved(problem, vector[:2], vector[2:], equation)[1].q[allowed]

    start, step = np.concatenate([weights, theta]), 1e-5
    for i, unit in enumerate(np.eye(len(start))):
        numeric = (q_at(start + step * unit) - q_at(start - step * unit)) / (2 * step)
        np.testing.assert_allclose(direct[allowed][:, i], numeric, atol=2e-6, rtol=1e-5)
