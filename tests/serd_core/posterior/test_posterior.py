"""Derivatives by finite differences, and likelihoods as sums over the decisions one by one."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import serd_core as sc
from serd_core.demonstrations.observations import observe
from serd_core.policies.solved_policy import MdcePolicy, PolicyMatchingPolicy
from serd_core.posterior import hessian as module
from serd_core.posterior.posterior import (
    Posterior,
    drawn_actions,
    expected_counts,
    require_possible,
)
from support.random_posteriors import (
    assert_gradient_is_of_the_objective,
    assert_hessian_is_of_the_gradient,
    assume_one_best_action_around,
    random_parameters,
    uniform_decisions,
)

BELIEFS = [sc.TiedBelief(), sc.FreeBelief(), sc.CoupledBelief(weight=0.7), sc.FixedBelief()]
POLICIES = [MdcePolicy(), PolicyMatchingPolicy(start_temperature=1.7)]


def posterior_of(random_problem, seed, policy_model, belief, share_hidden):
    """A posterior of random decisions of which some hide their action, and its parameters."""
    problem, table = random_problem(seed)
    rng = np.random.default_rng(seed)
    decisions = uniform_decisions(problem, table, rng)
    if not len(decisions):
        return None
    decisions = decisions.with_hidden_actions(rng.random(len(decisions)) < share_hidden)
    prior = sc.KldPrior(0.3, reference=table) + sc.KldPrior(0.2, table, sc.Block.BELIEF)
    prior = prior + sc.GaussianPrior(2.0, sc.Block.REWARD) + sc.DirichletPrior(0.3) + belief.prior
    posterior = Posterior(problem, observe(problem, decisions), policy_model, prior)
    like = random_parameters(problem, policy_model, rng)
    return posterior, belief.unpack(belief.pack(like), like), decisions


@pytest.mark.parametrize("belief", BELIEFS, ids=lambda belief: type(belief).__name__)
@pytest.mark.parametrize("policy_model", POLICIES, ids=lambda model: type(model).__name__)
@settings(deadline=None, max_examples=2)
@given(seed=st.integers(0, 10_000), share_hidden=st.sampled_from([0.0, 0.5, 1.0]))
def test_gradient_and_hessian_are_the_finite_differences(
    random_problem, policy_model, belief, seed, share_hidden
):
    made = posterior_of(random_problem, seed, policy_model, belief, share_hidden)
    if made is None:
        return
    posterior, parameters, _ = made
    if isinstance(policy_model, PolicyMatchingPolicy):
        assume_one_best_action_around(posterior, belief, parameters)
    assert_gradient_is_of_the_objective(posterior, belief, parameters)
    assert_hessian_is_of_the_gradient(posterior, belief, parameters)
    gradient = posterior.evaluate(parameters).gradient
    pulled = belief.jacobian(parameters).T @ gradient.vector
    np.testing.assert_allclose(belief.pull_back(gradient, parameters), pulled)
    model = posterior.problem.mdp.transitions
    for block in (gradient.belief, gradient.truth):
        of_gauge = block.reshape(model.n_models, -1).sum(axis=1)
        np.testing.assert_allclose(of_gauge, 0.0, atol=1e-8)


@pytest.mark.parametrize("policy_model", POLICIES, ids=lambda model: type(model).__name__)
@pytest.mark.parametrize("share_hidden", [0.0, 0.5])
def test_the_likelihood_is_the_sum_over_actions_of_each_decision(
    random_problem, policy_model, share_hidden
):
    """Naive twin: walk through the decisions one by one."""
    made = posterior_of(random_problem, 5, policy_model, sc.FreeBelief(), share_hidden)
    posterior, parameters, decisions = made
    found, model = posterior.evaluate(parameters), posterior.problem.mdp.transitions
    policy = np.exp(policy_model.log_probabilities(parameters.policy, found.solution.q))
    table, by_policy, by_move, hidden = model.local_probabilities(parameters.truth), 0.0, 0.0, 0.0
    columns = decisions.state, decisions.action, decisions.next_state
    for s, a, following in zip(*columns, strict=True):
        leads = model.successors[s] == following
        moves = np.sum(table[model.model_of[s]] * leads, axis=1)
        if a == sc.HIDDEN:
            hidden += np.log(policy[s] @ moves)
        else:
            by_policy, by_move = by_policy + np.log(policy[s, a]), by_move + np.log(moves[a])
    assert decisions.hidden.any() == (share_hidden > 0)
    assert found.hidden_log_likelihood == pytest.approx(hidden)
    assert found.policy_log_likelihood == pytest.approx(by_policy)
    assert found.dynamics_log_likelihood == pytest.approx(by_move)
    total = hidden + by_policy + by_move + found.log_prior
    assert found.objective == pytest.approx(total)


def test_dynamics_that_do_not_explain_a_move_are_rejected(minimum_example):
    observations = observe(minimum_example, sc.Decisions([0], [0.0], [0], [sc.HIDDEN], [1]))
    require_possible(observations, minimum_example.mdp, np.array([[1.0, 0.0], [0.5, 0.5]]))
    shown = observe(minimum_example, sc.Decisions([0], [0.0], [0], [0], [1]))
    with pytest.raises(sc.SerdError, match="from state 0 by action 0 to state 1"):
        require_possible(shown, minimum_example.mdp, np.array([[1.0, 0.0], [0.5, 0.5]]))
    with pytest.raises(sc.SerdError, match="from state 0 by any action to state 1"):
        require_possible(observations, minimum_example.mdp, np.array([[1.0, 0.0], [1.0, 0.0]]))


def test_drawn_actions_are_those_that_are_expected_on_average(random_problem):
    posterior, parameters, _ = posterior_of(random_problem, 3, MdcePolicy(), sc.TiedBelief(), 0.5)
    seen = posterior.observations
    _, true, _, log_policy = posterior.solved(parameters)
    expected = expected_counts(seen, log_policy, true).observations
    rng, n = np.random.default_rng(0), 2000
    drawn = [drawn_actions(seen, log_policy, true, rng) for _ in range(n)]
    for name in ("state_action", "group_count"):
        mean = np.mean([getattr(each, name) for each in drawn], axis=0)
        np.testing.assert_allclose(mean, getattr(expected, name), atol=5 * 3 / np.sqrt(n))
        assert all(getattr(each, name).sum() == seen.n_decisions for each in drawn)


def test_chunks_of_states_and_blocks_that_are_left_out_change_nothing(random_problem, monkeypatch):
    problem, table = random_problem(3)
    rng = np.random.default_rng(3)
    observations = observe(problem, uniform_decisions(problem, table, rng))
    prior = sc.KldPrior(0.3, reference=table) + sc.GaussianPrior(2.0, sc.Block.REWARD)
    posterior = Posterior(problem, observations, MdcePolicy(), prior)
    parameters = random_parameters(problem, MdcePolicy(), rng)
    found, reward = posterior.evaluate(parameters), parameters.place(sc.Block.REWARD)
    whole = module.posterior_hessian(posterior, parameters, found)
    alone = module.posterior_hessian(posterior, parameters, found, learns_dynamics=False)
    np.testing.assert_allclose(alone[reward, reward], whole[reward, reward], rtol=1e-12)
    monkeypatch.setattr(module, "CHUNK", 1)
    in_chunks = module.posterior_hessian(posterior, parameters, found)
    np.testing.assert_allclose(in_chunks, whole, rtol=1e-12, atol=1e-12)
