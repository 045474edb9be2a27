"""Algorithm 1 written out line by line with the thesis's own parts, as a twin of the learner."""

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
from lab.estimators.gradient_ascent import GradientAscent
from lab.estimators.value_iteration import ValueIteration
from lab.experiments.policy_cost import by_adjoint, by_lu, cost_case, soft_step
from serd_core.ascent.ascent import FunctionObjective
from serd_core.bellman.bellman_solver import BellmanProblem, HardBellman, Newton, SoftBellman
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.dynamics.transition_model import transitions_at
from serd_core.learners.serd import fit_mdce_serd
from support.objectives import TOP, never, quadratic


def algorithm_1(problem, decisions, weights, step_size, n_steps):
    """Lines 1 to 11 for MDCE SERD with tied belief: forward gradients, decision by decision."""
    mdp, model = problem.mdp, problem.mdp.transitions
    dynamics = model.parameters_of(estimate_dynamics(problem, decisions))
    theta = np.concatenate([weights, dynamics])
    for _ in range(n_steps):
        transitions = transitions_at(model, theta[2:])
        posed = BellmanProblem(SoftBellman(), problem.features @ theta[:2], transitions, mdp)
        solution = ValueIteration().solve(posed)
        policy = solution.policy
        jacobian = entry_jacobian(mdp, theta[2:])
        immediate = immediate_gradient(mdp, problem.features, solution.value, jacobian)
        q_gradient = q_gradient_by_iteration(mdp, transitions, policy, immediate).values
        gradient = np.zeros_like(theta)
        for s, a, following in zip(
            decisions.state, decisions.action, decisions.next_state, strict=True
        ):
            gradient += q_gradient[s, a] - policy[s] @ q_gradient[s]
            landing = (model.row == s * mdp.n_actions + a) & (model.successor == following)
            observed = transitions.entries[landing].sum()
            gradient[2:] += jacobian[landing].sum(axis=0) / observed
        theta = theta + step_size * gradient / len(decisions)
    return theta


def test_the_learner_takes_the_steps_of_algorithm_1(make_gridworld):
    case = make_gridworld(side=4, n_episodes=6, n_steps=10)
    start = np.array([1.0, -0.5])
    expected = algorithm_1(case.problem, case.decisions, start, 0.3, 5)
    ascent = GradientAscent(step_size=lambda _: 0.3, max_steps=5)
    fit = fit_mdce_serd(case.problem, case.decisions, initial_weights=start, ascent=ascent)
    np.testing.assert_allclose(fit.reward_weights, expected[:2], atol=1e-7)
    np.testing.assert_allclose(fit.parameters.truth, expected[2:], atol=1e-7)
    assert fit.n_steps == 5


def test_the_top_of_a_quadratic_is_found():
    ascent = GradientAscent(step_size=lambda _: 0.15)
    found = ascent.maximise(FunctionObjective(quadratic), np.zeros(2), never)
    np.testing.assert_allclose(found.vector, TOP, atol=1e-5)
    assert found.converged
    assert found.objective == pytest.approx(5.0)
    assert found.gradient_norm <= 1e-6
    assert found.message == "gradient within tolerance"
    assert len(found.objective_trace) == found.n_steps
    assert ascent.maximise(FunctionObjective(quadratic), TOP, never).n_steps == 0


def solved(problem, weights, theta, equation):
    transitions = transitions_at(problem.mdp.transitions, theta)
    posed = BellmanProblem(equation, problem.features @ weights, transitions, problem.mdp)
    return transitions, Newton().solve(posed)


def forward(problem, weights, theta, equation, method):
    transitions, solution = solved(problem, weights, theta, equation)
    jacobian = entry_jacobian(problem.mdp, theta)
    immediate = immediate_gradient(problem.mdp, problem.features, solution.value, jacobian)
    return method(problem.mdp, transitions, solution.policy, immediate)


@pytest.mark.parametrize("equation", [SoftBellman(), HardBellman()], ids=repr)
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


def test_repeated_soft_steps_approach_the_gradient_by_lu_which_is_that_of_the_adjoint():
    case = cost_case(9, 2, 3, np.random.default_rng(0))
    exact = by_lu(case)
    after = case.immediate + 0.9 * case.chain @ exact
    np.testing.assert_allclose(after, exact, atol=1e-10)
    np.testing.assert_allclose(soft_step(case), case.immediate + 0.9 * case.chain @ case.immediate)
    np.testing.assert_allclose(by_adjoint(case), case.immediate[:, 0] @ exact, atol=1e-10)
