import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from serd_core.bellman.linear.lu import SparseLu
from serd_core.bellman.newton import Newton
from serd_core.demonstrations.observations import observe
from serd_core.policies.policy_model import MdcePolicy, PolicyMatchingPolicy
from serd_core.posterior.beliefs import CoupledBelief, FixedBelief, FreeBelief, TiedBelief
from serd_core.posterior.parameters import Parameters
from serd_core.posterior.posterior import Posterior
from serd_core.priors.divergence import KldPrior
from support.random_posteriors import random_parameters, uniform_decisions

BELIEFS = [TiedBelief(), FreeBelief(), CoupledBelief(weight=0.7), FixedBelief()]
POLICIES = [MdcePolicy(), PolicyMatchingPolicy(start_temperature=1.7)]


def random_posterior(random_problem, seed, policy_model, belief):
    problem, table = random_problem(seed)
    rng = np.random.default_rng(seed)
    decisions = uniform_decisions(problem, table, rng)
    if not len(decisions):
        return None
    prior = (KldPrior(0.3, reference=table) + belief.prior).anchored(table)
    posterior = Posterior(
        problem, observe(problem.mdp, decisions), policy_model, prior, Newton(), SparseLu()
    )
    parameters = random_parameters(problem, policy_model, rng)
    return posterior, belief.unpack(belief.pack(parameters), parameters)


@pytest.mark.parametrize("belief", BELIEFS, ids=lambda belief: type(belief).__name__)
@pytest.mark.parametrize("policy_model", POLICIES, ids=lambda model: type(model).__name__)
@settings(deadline=None, max_examples=12)
@given(seed=st.integers(0, 10_000))
def test_the_gradient_is_the_finite_difference(random_problem, policy_model, belief, seed):
    made = random_posterior(random_problem, seed, policy_model, belief)
    if made is None:
        return
    posterior, parameters = made
    vector = belief.pack(parameters)
    gradient = belief.pull_back(posterior.evaluate(parameters).gradient, parameters)
    step = 1e-6
    numeric = [
        (
            posterior.evaluate(belief.unpack(vector + step * unit, parameters)).objective
            - posterior.evaluate(belief.unpack(vector - step * unit, parameters)).objective
        )
        / (2 * step)
        for unit in np.eye(len(vector))
    ]
    np.testing.assert_allclose(gradient, numeric, rtol=1e-5, atol=2e-5)


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
