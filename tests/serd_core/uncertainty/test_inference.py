"""Sandwich, clusters, bootstrap and likelihood ratio, by closed forms and simulation."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.stats

import serd_core as sc
from serd_core.errors import SerdError


def bandit(n_features=1):
    """One state, two actions: the choice is a logit of the weights; a second feature is 0 at b."""
    features = np.zeros((1, 2, n_features))
    features[0, 0, 0] = 1.0
    return sc.from_transitions(np.ones((1, 2, 1)), features, discount=0.5)


def choices(actions, episode=None):
    actions = np.asarray(actions)
    zeros = np.zeros(len(actions), int)
    number = np.arange(len(actions)) if episode is None else episode
    return sc.Decisions(number, np.arange(len(actions)), zeros, actions, zeros)


def fitted(problem, decisions, **options):
    start = np.zeros(len(problem.feature_names))
    return sc.fit_mdce_irl_by_likelihood(problem, decisions, initial_weights=start, **options)


def test_the_sandwich_of_a_logit_is_its_closed_form():
    """Scores are 1 - p and -p, so B = A = n p (1 - p), and all errors are equal."""
    problem, decisions = bandit(), choices([0] * 30 + [1] * 70)
    information = sc.fit_information(problem, decisions, fitted(problem, decisions))
    plain = sc.standard_errors(problem, information)
    robust = sc.standard_errors(problem, information, meat=information.outer_product)
    assert plain.reward[0] == pytest.approx(1 / np.sqrt(100 * 0.3 * 0.7), rel=1e-6)
    assert robust.reward[0] == pytest.approx(plain.reward[0], rel=1e-6)


def test_clusters_of_equal_choices_count_as_one_choice():
    """Ten equal choices per episode: sqrt(10) times the error, with C / (C - 1)."""
    actions = np.repeat([0] * 6 + [1] * 14, 10)
    problem, decisions = bandit(), choices(actions, np.repeat(np.arange(20), 10))
    information = sc.fit_information(problem, decisions, fitted(problem, decisions))
    meat = sc.clustered_outer_product(problem, information, decisions)
    by_cluster = sc.standard_errors(problem, information, meat=meat).reward[0]
    plain = sc.standard_errors(problem, information).reward[0]
    assert by_cluster / plain == pytest.approx(np.sqrt(10 * 20 / 19), rel=1e-6)
    hidden = decisions.with_hidden_actions()
    for given, clusters, sentence in (
        (decisions, np.zeros(200, int), "clusters must be at least 2, got 1"),
        (hidden, None, "decisions must show their actions"),
    ):
        with pytest.raises(sc.SerdError, match=sentence):
            sc.clustered_outer_product(problem, information, given, clusters)
    others = sc.fit_information(problem, choices([0, 0]), fitted(problem, decisions))
    with pytest.raises(sc.SerdError, match="must be those of the information, got decision 60"):
        sc.clustered_outer_product(problem, others, decisions)


def test_a_bootstrap_of_a_mean_has_its_error_and_keeps_episodes_whole():
    actions = np.repeat([0] * 60 + [1] * 140, 5)
    decisions = choices(actions, np.repeat(np.arange(200), 5))
    found = sc.bootstrap(
        decisions, lambda sample: sample.action.mean(), rng=np.random.default_rng(0), n=400
    )
    assert found.standard_errors == pytest.approx(np.sqrt(0.7 * 0.3 / 200), rel=0.1)
    with pytest.raises(sc.SerdError, match=r"rng must be a numpy\.random\.Generator, got 0"):
        sc.bootstrap(decisions, lambda sample: sample.action.mean(), rng=0)


def test_a_bootstrap_names_the_sample_whose_estimate_is_not_a_number():
    decisions, counted = choices([0, 1, 1]), []

    def estimate(sample):
        counted.append(sample)
        return np.array([0.0, np.nan if len(counted) == 3 else 1.0])

    with pytest.raises(sc.SerdError, match="got NaN for sample 2 of 5"):
        sc.bootstrap(decisions, estimate, rng=np.random.default_rng(0), n=5)


def two_arms():
    """Two states of choice that follow each other; a feature for choosing a in each."""
    transitions = np.zeros((2, 2, 2))
    transitions[0, :, 1] = transitions[1, :, 0] = 1.0
    features = np.zeros((2, 2, 2))
    features[0, 0, 0] = features[1, 0, 1] = 1.0
    wide = sc.from_transitions(transitions, features, discount=0.5, feature_names=("x", "y"))
    narrow = sc.from_transitions(
        transitions, features[:, :, :1], discount=0.5, feature_names=("x",)
    )
    return narrow, wide


def alternate(rng, n, p_second):
    action = np.where(np.arange(n) % 2 == 0, rng.random(n) < 0.4, rng.random(n) < p_second)
    state = np.arange(n) % 2
    return sc.Decisions(np.arange(n) // 2, np.arange(n) % 2, state, action.astype(int), 1 - state)


def test_the_likelihood_ratio_of_a_coin_is_its_closed_form():
    """y = 0 means a fair coin in the second state: G = 2 n KL."""
    narrow, wide = two_arms()
    decisions = alternate(np.random.default_rng(3), 400, 0.6)
    share = decisions.action[1::2].mean()
    restricted, full = fitted(narrow, decisions), fitted(wide, decisions)
    ratio = sc.likelihood_ratio_test(restricted, full)
    entropy = share * np.log(2 * share) + (1 - share) * np.log(2 * (1 - share))
    assert ratio.statistic == pytest.approx(2 * 200 * entropy, rel=1e-5)
    assert ratio.degrees_of_freedom == 1
    assert ratio.p_value == pytest.approx(scipy.stats.chi2.sf(ratio.statistic, 1))


def test_p_values_of_a_true_restriction_are_uniform():
    narrow, wide = two_arms()
    rng, values = np.random.default_rng(0), []
    for _ in range(60):
        decisions = alternate(rng, 200, 0.5)
        found = sc.likelihood_ratio_test(fitted(narrow, decisions), fitted(wide, decisions))
        values.append(found.p_value)
    assert scipy.stats.kstest(values, "uniform").pvalue > 0.01


def random_problem(seed, scale=1.0):
    rng = np.random.default_rng(seed)
    table, features = rng.dirichlet(np.ones(5), size=(5, 3)), scale * rng.normal(size=(5, 3, 2))
    problem = sc.from_transitions(table, features, discount=0.9)
    policy = sc.soft_policy(problem, np.array([1.0, -0.7]) / scale).probabilities
    return problem, sc.sample_decisions(problem.mdp, policy, n_episodes=40, n_steps=10, rng=rng)


@pytest.mark.parametrize("seed", range(2))
def test_policy_matching_alone_does_not_determine_the_scale_of_rewards(seed):
    problem, decisions = random_problem(seed)
    fit = sc.fit_pm_serd(problem, decisions, initial_weights=np.zeros(2))
    assert np.isinf(
        sc.standard_errors(problem, sc.fit_information(problem, decisions, fit)).reward
    ).all()
    held = sc.fit_pm_serd(
        problem,
        decisions,
        initial_weights=np.zeros(2),
        prior=sc.GaussianPrior(0.1, sc.Block.POLICY, 1.0),
    )
    errors = sc.standard_errors(problem, sc.fit_information(problem, decisions, held)).reward
    assert np.isfinite(errors).all()


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_units_of_features_change_no_fit(scale):
    (problem, decisions), (other, same) = random_problem(1), random_problem(1, scale)
    np.testing.assert_array_equal(decisions.action, same.action)
    for fit in (
        sc.fit_mdce_irl_by_likelihood,
        sc.fit_mdce_irl_by_entropy,
        sc.fit_maxent_irl,
        sc.fit_policy_matching,
    ):
        wanted = fit(problem, decisions, initial_weights=np.zeros(2))
        found = fit(other, same, initial_weights=np.zeros(2))
        assert found.converged, found.message
        np.testing.assert_allclose(found.reward_weights * scale, wanted.reward_weights, atol=1e-3)


def test_tests_of_likelihoods_refuse_what_is_not_nested_or_not_by_likelihood():
    narrow, wide = two_arms()
    decisions = alternate(np.random.default_rng(3), 400, 0.6)
    restricted, full = fitted(narrow, decisions), fitted(wide, decisions)
    fewer = fitted(narrow, decisions.select(np.arange(398)))
    with_prior = fitted(narrow, decisions, prior=sc.GaussianPrior(1.0, sc.Block.REWARD))
    for less, more, number, sentence in (
        (with_prior, full, None, "must have fits that converged without a prior"),
        (full, restricted, None, "n_restrictions must be at least 1, got -1"),
        (fewer, full, None, "same decisions, got 398 and 400 decisions"),
        (full, restricted, 1, r"full must be at least as likely .* a gain of -"),
        (replace(restricted, assumptions=None), full, None, "got assumptions=None; fit again"),
    ):
        with pytest.raises(sc.SerdError, match=sentence):
            sc.likelihood_ratio_test(less, more, n_restrictions=number)
    problem, decisions = random_problem(0)
    likely = fitted(problem, decisions)
    for fit in (sc.fit_mdce_irl_by_entropy, sc.fit_maxent_irl, sc.fit_policy_matching):
        other = fit(problem, decisions, initial_weights=np.zeros(2))
        with pytest.raises(SerdError, match="by another criterion; use fit_mdce_irl_by_likelihood"):
            sc.likelihood_ratio_test(other, likely, n_restrictions=1)
