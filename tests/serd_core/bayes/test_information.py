"""What informed each outcome model, and what one more demonstration would add."""

import numpy as np
import pytest
import scipy.integrate
import scipy.stats

import serd_core as sc
from support.small_problems import PROPER, apart, fit_of, one_choice, room, sampled

C = 0.7


def two_ways(discount, n_features=1):
    """Two ways lead from state 0 to state 1, where the first feature is 1.

    Each way has a model of two outcomes, arrive or stay; the third model is used nowhere. The
    second feature is 1 where the second way is taken.
    """
    successors = np.array([[[1, 0], [1, 0]], [[1, 1], [1, 1]]])
    available = np.array([[True, True], [True, False]])
    models = sc.OutcomeModels(
        successors, np.array([[0, 1], [0, 0]]), available, n_models=3, intended=[0, 0, 0]
    )
    table = np.zeros((2, 2, 2))
    table[1, :, 0] = table[0, 1, 1] = 1.0
    names = ("goal", "second")[:n_features]
    return sc.TabularProblem(sc.Mdp(models, discount), table[:, :, :n_features], names)


def known(problem, decisions, mass=0.9, **options):
    start = {"initial_weights": np.ones(len(problem.feature_names)), "prior": PROPER}
    fit = sc.fit_mdce_serd(problem, decisions, **start | options)
    return sc.outcome_information(sc.laplace(problem, decisions, fit), mass)


@pytest.mark.parametrize("ratio", [1.0, 4.0])
def test_without_a_future_only_counts_inform_by_the_divergence_of_beta_distributions(ratio):
    prior = sc.GaussianPrior(2.0, sc.Block.REWARD) + sc.DirichletPrior(C, intended_ratio=ratio)
    found = known(two_ways(0.0), apart(0, 0, np.arange(12) < 9), prior=prior)
    after, before = scipy.stats.beta(9 + ratio * C, 3 + C), scipy.stats.beta(ratio * C, C)
    divergence = scipy.integrate.quad(
        lambda p: after.pdf(p) * (after.logpdf(p) - before.logpdf(p)), 0, 1
    )[0]
    np.testing.assert_allclose(found.from_transitions, [divergence, 0.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(found.from_choices, 0.0, atol=1e-6)
    np.testing.assert_allclose(found.shared, 0.0, atol=1e-9)
    np.testing.assert_array_equal(found.n_decisions, [12, 0, 0])
    assert [found.source(m) for m in range(3)] == ["counts", "prior only", "prior only"]


def test_an_avoided_way_is_known_from_choices_unless_a_feature_explains_the_same():
    decisions, problem = apart(0, 0, np.arange(40) < 20), two_ways(0.95, n_features=2)
    alone, both = known(two_ways(0.95), decisions), known(problem, decisions)
    assert alone.from_transitions[1] == 0.0
    assert alone.from_choices[1] > 0.1
    assert [alone.source(m) for m in (1, 2)] == ["choices", "prior only"]
    # It fails, or the goal is not liked and it succeeds: both are in the posterior.
    assert alone.lower[1, 0] < 0.1
    assert alone.upper[1, 0] > 0.9
    assert both.from_choices[1] < 0.7 * alone.from_choices[1]
    assert both.shared[1] > alone.shared[1]
    assert problem.feature_names[both.partner[1]] == "second"


def test_both_explanations_of_an_avoided_way_are_drawn_as_often_as_by_quadrature():
    """Section 4.6.1: the goal is liked and the way fails, or neither."""
    decisions, discount = apart(0, 0, np.arange(12) < 6), 0.8
    weight = np.linspace(-8.0, 8.0, 81)[:, None, None]
    odds = [np.linspace(-lim, lim, 61).reshape(shape) for lim, shape in ((3, (61, 1)), (8, 61))]
    p, q = (1.0 / (1.0 + np.exp(-each)) for each in odds)
    arrived, value = weight / (1.0 - discount), 0.0
    for _ in range(120):
        taken, other = (discount * (each * arrived + (1 - each) * value) for each in (p, q))
        value = np.logaddexp(taken, other)
    density = 12 * (taken - value) + 6 * np.log(p * (1 - p)) - 0.5 * (weight / 2.0) ** 2
    density = np.exp(density + C * np.log(p * (1 - p) * q * (1 - q)))
    exact = density[weight.ravel() > 0].sum() / density.sum()
    fit = sc.fit_mdce_serd(two_ways(discount), decisions, initial_weights=np.ones(1), prior=PROPER)
    found = sc.laplace(two_ways(discount), decisions, fit)
    # 64 chains leap seldom, so each draw of them is worth few.
    draws = [sc.interval_draws(found, np.random.default_rng(seed)) for seed in range(6)]
    liked = [np.mean(each.reward > 0.0) for each in draws]
    assert np.mean(liked) == pytest.approx(exact, abs=0.06)


def test_choices_by_a_belief_of_its_own_inform_nothing_of_the_truth():
    prior = PROPER + sc.DirichletPrior(C, sc.Block.BELIEF)
    decisions = apart(0, 0, np.arange(30) < 20)
    found = known(two_ways(0.95), decisions, belief=sc.FreeBelief(), prior=prior)
    np.testing.assert_allclose(found.from_choices, 0.0, atol=1e-6)
    np.testing.assert_allclose(found.shared, 0.0, atol=1e-9)


@pytest.mark.parametrize("mass", [0.5, 0.95])
def test_intervals_hold_the_mass_they_state(mass):
    found = known(two_ways(0.0), apart(0, 0, np.arange(200) < 150), mass)
    exact, place = scipy.stats.beta(150 + C, 50 + C), (0, 0)
    held = exact.cdf(found.upper[place]) - exact.cdf(found.lower[place])
    assert held == pytest.approx(mass, abs=0.03)
    assert found.median[place] == pytest.approx(exact.median(), abs=0.01)


def test_a_fit_of_rewards_alone_is_rejected(gridworld):
    options = {"dynamics": gridworld.probabilities, "prior": sc.GaussianPrior(2.0, sc.Block.REWARD)}
    fit = fit_of(gridworld, [0.0, 0.0], fit=sc.fit_mdce_irl_by_likelihood, **options)
    with pytest.raises(sc.SerdError, match=r"must have learned outcome models, got one of rewards"):
        sc.outcome_information(sc.laplace(gridworld.problem, gridworld.decisions, fit))


def test_the_gain_of_one_decision_of_a_logistic_model_with_counted_outcomes():
    """gain = 1/2 log(1 + s_w pi (1 - pi)) + 1/2 log(1 + s_u p (1 - p) |D|^2), by hand."""
    problem, decisions = one_choice(9, 4)
    fit = sc.fit_mdce_serd(problem, decisions, initial_weights=np.zeros(1), prior=PROPER)
    found = sc.laplace(problem, decisions, fit)
    taken = 1.0 / (1.0 + np.exp(-fit.reward_weights[0]))
    arrived, apart = fit.outcome_probabilities[0, 0], np.array([1.0, -1.0])
    by_weight = found.covariance[0, 0] * taken * (1.0 - taken)
    by_outcome = apart @ found.covariance[1:, 1:] @ apart * arrived * (1.0 - arrived)
    gain = sc.expected_information_gain(found, longest=1)
    assert gain[0] == pytest.approx(0.5 * np.log1p(by_weight) + 0.5 * np.log1p(by_outcome))
    # The other state has no outcome to learn, and actions of equal reward show the weight is 0.
    assert gain[1] == pytest.approx(0.0, abs=1e-12)


def test_states_that_end_an_episode_add_nothing():
    """A line of five cells, of which the last ends the episode."""
    problem, table = room(1, 5, 4, discount=0.9), np.full((4, 5), 0.05) + 0.75 * np.eye(5)[[1] * 4]
    policy = sc.soft_policy(problem, [1.0, 0.0, 0.0], table).probabilities
    decisions = sampled(problem, policy, table, 9, 30)
    found = sc.laplace(problem, decisions, sc.fit_mdce_serd(problem, decisions))
    gain = sc.expected_information_gain(found)
    assert problem.mdp.final.tolist() == [False] * 4 + [True]
    assert gain[4] == 0.0
    assert np.all(gain[:4] > 0)
    with pytest.raises(sc.SerdError, match="longest must be at least 1 decision, got 0"):
        sc.expected_information_gain(found, longest=0)
