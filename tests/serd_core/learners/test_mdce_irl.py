import numpy as np
import pytest

import serd_core as sc
from serd_core.demonstrations.decisions import start_distribution
from serd_core.demonstrations.simulation import feature_counts, trajectories_of
from serd_core.dynamics.transition_model import transitions_of
from serd_core.learners.mdce_irl import state_action_occupancy
from support.small_problems import fit_of, sampled

TRUE = np.array([1.0, -1.0])


def features_reached(problem, transitions, policy, starts):
    visits = state_action_occupancy(problem.mdp, transitions, policy, starts)
    return np.tensordot(visits, problem.features, axes=2)


@pytest.fixture(scope="module")
def long_case(make_gridworld):
    """Episodes long against the horizon 1 / (1 - 0.8)."""
    return make_gridworld(side=5, discount=0.8, n_episodes=600, n_steps=60)


@pytest.mark.parametrize("slack", [0.0, 0.01])
def test_at_the_entropy_optimum_the_features_match_up_to_the_slack_by_the_weights(long_case, slack):
    problem, decisions, table = long_case.problem, long_case.decisions, long_case.probabilities
    options = {"dynamics": table, "slack": slack}
    fit = fit_of(long_case, [0.0, 0.0], fit=sc.fit_mdce_irl_by_entropy, **options)
    assert fit.converged
    policy = sc.soft_policy(problem, fit.reward_weights, table).probabilities
    transitions, starts = transitions_of(problem.mdp.transitions, table), decisions
    reached = features_reached(problem, transitions, policy, start_distribution(starts, 25))
    wanted = feature_counts(problem, decisions).mean(axis=0)
    scale = 1 - problem.mdp.discount
    np.testing.assert_allclose((wanted - reached) * scale, slack * fit.reward_weights, atol=1e-5)


@pytest.mark.parametrize("discount", [0.99, 0.999999])
def test_the_features_of_episodes_that_end_match_near_a_discount_of_1_too(discount):
    """Trying to end counts gamma^t once, however small 1 - gamma is."""
    moves = np.array([[[0.5, 0.5, 0], [0.1, 0, 0.9]], [[0, 1, 0]] * 2, [[0, 0, 1]] * 2])
    tried = np.zeros((3, 2, 1))
    tried[0, 1] = 1.0
    problem = sc.from_transitions(moves, tried, discount=discount, terminal=[1, 2])
    decisions = sc.decisions_from_episodes([([0, 1], [0]), ([0, 0, 1], [0, 0]), ([0, 2], [1])])
    transitions = transitions_of(problem.mdp.transitions, None)
    wanted = feature_counts(problem, decisions).mean(axis=0)
    for start in (0.0, 3.0):
        fit = sc.fit_mdce_irl_by_entropy(problem, decisions, initial_weights=[start])
        assert fit.converged
        policy = sc.soft_policy(problem, fit.reward_weights).probabilities
        reached = features_reached(problem, transitions, policy, np.array([1.0, 0, 0]))
        np.testing.assert_allclose(reached, wanted, atol=1e-5)


def test_known_dynamics_with_zeros_give_the_limit_of_smoothed_ones(gridworld):
    """The truth of section 4.6.2 rules outcomes out: waiting is certain, nothing goes back."""
    known, fits = gridworld.probabilities, {}
    for least in (0.0, 1e-12):
        table = np.maximum(known, least)
        table /= table.sum(axis=1, keepdims=True)
        options = {"dynamics": table, "ascent": sc.TrustRegion(gradient_tolerance=1e-9)}
        fits[least] = fit_of(gridworld, [0.0, 0.0], fit=sc.fit_mdce_irl_by_likelihood, **options)
        assert fits[least].converged
    exact = fits[0.0]
    np.testing.assert_array_equal(exact.outcome_probabilities == 0, known == 0)
    np.testing.assert_allclose(exact.outcome_probabilities, known, rtol=1e-12)
    np.testing.assert_allclose(exact.reward_weights, fits[1e-12].reward_weights, rtol=1e-6)
    assert np.isfinite(exact.objective)
    with pytest.raises(sc.SerdError, match=r"probabilities\[0, 1\] must be above 0 .* FixedBelief"):
        fit_of(gridworld, [0.0, 0.0], dynamics=known)


def test_absorbed_episodes_count_for_ever(minimum_example):
    policy = np.array([[1.0, 0, 0], [0, 0, 1.0]])
    decisions = sampled(minimum_example, policy, np.full((2, 2), 0.5), 20, 200, 0, [1.0, 0.0])
    discounts = 0.9 ** trajectories_of(decisions).length.astype(float)
    expected = -(1 - discounts) / 0.1 + discounts / 0.1
    np.testing.assert_allclose(feature_counts(minimum_example, decisions)[:, 0], expected)


@pytest.mark.parametrize(("n_steps", "seed"), [(1, 1), (60, 2)])
def test_the_weights_do_not_depend_on_where_episodes_were_cut_off(n_steps, seed):
    rng = np.random.default_rng(seed)
    moves = rng.dirichlet(np.full(12, 0.3), size=(12, 3))
    problem = sc.from_transitions(moves, rng.normal(size=(12, 3, 2)), discount=0.95)
    policy, rng = sc.soft_policy(problem, TRUE).probabilities, np.random.default_rng(2)
    size = {"n_episodes": 20_000 // n_steps, "n_steps": n_steps}
    decisions = sc.sample_decisions(problem.mdp, policy, **size, rng=rng)
    fit = sc.fit_mdce_irl_by_entropy(problem, decisions, initial_weights=np.zeros(2))
    assert fit.converged
    np.testing.assert_allclose(fit.reward_weights, TRUE, atol=0.35)
