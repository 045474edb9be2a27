import numpy as np
import pytest

from serd_core.bellman.linear.lu import SparseLu
from serd_core.bellman.newton import Newton
from serd_core.demonstrations.observations import observe
from serd_core.policies.policy_model import MdcePolicy
from serd_core.posterior.parameters import Parameters
from serd_core.posterior.posterior import Posterior
from serd_core.priors.divergence import KldPrior


def test_value_is_the_sum_of_log_probabilities_of_the_decisions(gridworld):
    """Naive twin: walk through the decisions one by one."""
    problem, decisions = gridworld.problem, gridworld.decisions
    table = np.clip(gridworld.probabilities, 1e-3, None)
    table /= table.sum(axis=1, keepdims=True)
    model = problem.mdp.transitions
    theta = model.parameters_of(table)
    posterior = Posterior(
        problem,
        observe(problem.mdp, decisions),
        MdcePolicy(),
        KldPrior(0.0, reference=table),
        Newton(),
        SparseLu(),
    )
    found = posterior.evaluate(Parameters(gridworld.weights, theta, theta, np.zeros(0)))
    by_policy, by_dynamics = 0.0, 0.0
    for s, a, following in zip(
        decisions.state, decisions.action, decisions.next_state, strict=True
    ):
        by_policy += np.log(found.solution.policy[s, a])
        landing = model.successors[s, a] == following
        by_dynamics += np.log(table[model.model_of[s, a]][landing].sum())
    assert found.policy_log_likelihood == pytest.approx(by_policy)
    assert found.dynamics_log_likelihood == pytest.approx(by_dynamics)


def test_shifting_the_energies_of_a_model_changes_nothing(gridworld):
    """The softmax gauge: the gradient has no part along it."""
    problem = gridworld.problem
    posterior = Posterior(
        problem,
        observe(problem.mdp, gridworld.decisions),
        MdcePolicy(),
        KldPrior(0.1, reference=np.full((9, 5), 0.2)),
        Newton(),
        SparseLu(),
    )
    theta = np.random.default_rng(0).normal(size=45)
    gradient = posterior.evaluate(Parameters(gridworld.weights, theta, theta, np.zeros(0))).gradient
    np.testing.assert_allclose(gradient.belief.reshape(9, 5).sum(axis=1), 0, atol=1e-9)
    np.testing.assert_allclose(gradient.truth.reshape(9, 5).sum(axis=1), 0, atol=1e-9)
