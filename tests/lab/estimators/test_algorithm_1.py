"""Algorithm 1 written out line by line with the thesis's own parts, as a twin of the learner."""

import numpy as np

from lab.estimators.forward_gradients import (
    entry_jacobian,
    immediate_gradient,
    q_gradient_by_iteration,
)
from lab.estimators.gradient_ascent import GradientAscent
from lab.estimators.value_iteration import ValueIteration
from serd_core.bellman.bellman_solver import BellmanProblem, SoftBellman
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.dynamics.transition_model import transitions_at
from serd_core.learners.serd import fit_mdce_serd


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
    fit = fit_mdce_serd(
        case.problem,
        case.decisions,
        initial_weights=start,
        ascent=GradientAscent(step_size=lambda _: 0.3, max_steps=5),
    )
    np.testing.assert_allclose(fit.reward_weights, expected[:2], atol=1e-7)
    np.testing.assert_allclose(fit.parameters.truth, expected[2:], atol=1e-7)
    assert fit.n_steps == 5
