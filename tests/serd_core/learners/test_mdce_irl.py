import numpy as np
import pytest

from serd_core.ascent.trust_region import TrustRegion
from serd_core.demonstrations.decisions import (
    Decisions,
    decisions_from_episodes,
    start_distribution,
)
from serd_core.demonstrations.trajectories import feature_counts, trajectories_of
from serd_core.dynamics.transition_model import transitions_of
from serd_core.errors import SerdError
from serd_core.learners.mdce_irl import (
    feature_expectation,
    fit_mdce_irl_by_entropy,
    fit_mdce_irl_by_likelihood,
    weights_under_initial_dynamics,
)
from serd_core.mdp.tables import from_transitions
from serd_core.policies.solved_policy import soft_policy
from support.small_problems import fit_of, sampled


@pytest.fixture(scope="module")
def long_case(make_gridworld):
    """Episodes long against the horizon 1 / (1 - 0.8)."""
    return make_gridworld(side=5, discount=0.8, n_episodes=600, n_steps=60)


@pytest.mark.parametrize("slack", [0.0, 0.01])
def test_at_the_entropy_optimum_the_features_match_up_to_the_slack_by_the_weights(long_case, slack):
    problem, decisions, table = long_case.problem, long_case.decisions, long_case.probabilities
    fit = fit_mdce_irl_by_entropy(
        problem, decisions, initial_weights=np.zeros(2), dynamics=table, slack=slack
    )
    assert fit.converged
    policy = soft_policy(problem, fit.reward_weights, table).probabilities
    transitions = transitions_of(problem.mdp.transitions, table)
    starts = start_distribution(decisions, 25)
    reached = feature_expectation(problem, transitions, policy, starts)
    wanted = feature_counts(problem, decisions).mean(axis=0)
    scale = 1 - problem.mdp.discount
    np.testing.assert_allclose((wanted - reached) * scale, slack * fit.reward_weights, atol=1e-5)


@pytest.mark.parametrize("discount", [0.99, 0.999999])
def test_the_features_of_episodes_that_end_match_near_a_discount_of_1_too(discount):
    """Trying to end counts gamma^t once, however small 1 - gamma is."""
    moves = np.array([[[0.5, 0.5, 0], [0.1, 0, 0.9]], [[0, 1, 0]] * 2, [[0, 0, 1]] * 2])
    tried = np.zeros((3, 2, 1))
    tried[0, 1] = 1.0
    problem = from_transitions(moves, tried, discount=discount, terminal=[1, 2])
    decisions = decisions_from_episodes([([0, 1], [0]), ([0, 0, 1], [0, 0]), ([0, 2], [1])])
    fits = [
        fit_mdce_irl_by_entropy(problem, decisions, initial_weights=[start]) for start in (0.0, 3.0)
    ]
    assert all(fit.converged for fit in fits)
    for fit in fits:
        policy = soft_policy(problem, fit.reward_weights).probabilities
        reached = feature_expectation(
            problem, transitions_of(problem.mdp.transitions, None), policy, np.array([1.0, 0, 0])
        )
        wanted = feature_counts(problem, decisions).mean(axis=0)
        np.testing.assert_allclose(reached, wanted, atol=1e-5)


def test_entropy_and_likelihood_agree_for_many_demonstrations_under_true_dynamics(long_case):
    arguments = {"initial_weights": np.zeros(2), "dynamics": long_case.probabilities}
    matched = fit_mdce_irl_by_entropy(long_case.problem, long_case.decisions, **arguments)
    likely = fit_mdce_irl_by_likelihood(long_case.problem, long_case.decisions, **arguments)
    np.testing.assert_allclose(matched.reward_weights, long_case.weights, atol=0.3)
    np.testing.assert_allclose(likely.reward_weights, long_case.weights, atol=0.15)


def test_known_dynamics_with_zeros_give_the_limit_of_smoothed_ones(gridworld):
    """The truth of section 4.6.2 rules outcomes out: waiting is certain, nothing goes back."""
    known = gridworld.probabilities
    assert np.any(known == 0)
    fits = {}
    for least in (0.0, 1e-12):
        smoothed = np.maximum(known, least)
        smoothed /= smoothed.sum(axis=1, keepdims=True)
        fits[least] = fit_of(
            gridworld,
            [0.0, 0.0],
            fit=fit_mdce_irl_by_likelihood,
            dynamics=smoothed,
            ascent=TrustRegion(gradient_tolerance=1e-9),
        )
        assert fits[least].converged
    np.testing.assert_array_equal(fits[0.0].outcome_probabilities == 0, known == 0)
    np.testing.assert_allclose(fits[0.0].outcome_probabilities, known, rtol=1e-12)
    np.testing.assert_allclose(fits[0.0].reward_weights, fits[1e-12].reward_weights, rtol=1e-6)
    assert np.isfinite(fits[0.0].objective)


def test_learned_dynamics_may_not_start_at_zeros_and_the_sentence_says_who_may(gridworld):
    with pytest.raises(SerdError, match=r"probabilities\[0, 1\] must be above 0 .* FixedBelief"):
        fit_of(gridworld, [0.0, 0.0], dynamics=gridworld.probabilities)


def test_dynamics_that_rule_an_observed_step_out_are_refused_by_its_name(minimum_example):
    zero = np.zeros(1, dtype=int)
    decisions = Decisions(zero, zero, zero, zero, zero + 1)
    with pytest.raises(SerdError, match="rule out the observed step from state 0 by action 0 to"):
        fit_mdce_irl_by_likelihood(
            minimum_example,
            decisions,
            initial_weights=np.zeros(1),
            dynamics=np.array([[1.0, 0.0], [0.5, 0.5]]),
        )


def test_occupancy_of_any_policy_sums_to_the_geometric_series(random_problem):
    problem, table = random_problem(3)
    ones = np.ones((*problem.mdp.available.shape, 1))
    plain = type(problem)(problem.mdp, ones, ("one",))
    uniform = problem.mdp.available / problem.mdp.available.sum(axis=1, keepdims=True)
    starts = np.full(problem.mdp.n_states, 1 / problem.mdp.n_states)
    total = feature_expectation(
        plain, transitions_of(problem.mdp.transitions, table), uniform, starts
    )
    assert total[0] == pytest.approx(1 / (1 - problem.mdp.discount))


def test_feature_counts_continue_in_an_absorbing_state(minimum_example):
    policy, table = np.array([[1.0, 0, 0], [0, 0, 1.0]]), np.full((2, 2), 0.5)
    decisions = sampled(minimum_example, policy, table, 20, 200, 0, [1.0, 0.0])
    lengths = trajectories_of(decisions).length
    discounts = 0.9 ** lengths.astype(float)
    expected = -(1 - discounts) / 0.1 + discounts / 0.1
    np.testing.assert_allclose(feature_counts(minimum_example, decisions)[:, 0], expected)


def test_large_rewards_and_episodes_stuck_in_one_state_are_no_trouble(gridworld):
    fit = fit_mdce_irl_by_entropy(
        gridworld.problem, gridworld.decisions, initial_weights=np.array([1e3, -1e3])
    )
    assert np.all(np.isfinite(fit.reward_weights))
    assert fit.converged


def test_weights_stay_finite_where_every_demonstration_agrees(make_gridworld):
    case = make_gridworld(side=4, n_episodes=1, n_steps=1)
    assert np.all(np.isfinite(weights_under_initial_dynamics(case.problem, case.decisions)))
