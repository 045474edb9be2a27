"""Sandwich, clusters, bootstrap and likelihood ratio, by closed forms and simulation."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.stats

import serd_core as sc


def fitted(problem, decisions, fit=sc.fit_mdce_irl_by_likelihood, **options):
    start = np.zeros(len(problem.feature_names))
    return fit(problem, decisions, initial_weights=start, **options)


def informed(problem, decisions, **options):
    """The information of a fit from weights of 0."""
    return sc.fit_information(problem, decisions, fitted(problem, decisions, **options))


#: One state, two actions: the choice is a logit of the weight.
BANDIT = sc.from_transitions(np.ones((1, 2, 1)), np.array([[[1.0], [0.0]]]), discount=0.5)


def choices(actions, episode=None):
    actions = np.asarray(actions)
    zeros = np.zeros(len(actions), int)
    number = np.arange(len(actions)) if episode is None else episode
    return sc.Decisions(number, np.arange(len(actions)), zeros, actions, zeros)


def test_the_sandwich_of_a_logit_is_its_closed_form():
    """Scores are 1 - p and -p, so B = A = n p (1 - p), and all errors are equal."""
    information = informed(BANDIT, choices([0] * 30 + [1] * 70))
    plain = sc.standard_errors(BANDIT, information)
    robust = sc.standard_errors(BANDIT, information, meat=information.outer_product)
    assert plain.reward[0] == pytest.approx(1 / np.sqrt(100 * 0.3 * 0.7), rel=1e-6)
    assert robust.reward[0] == pytest.approx(plain.reward[0], rel=1e-6)


def test_clusters_of_equal_choices_count_as_one_choice():
    """Ten equal choices per episode: sqrt(10) times the error, with C / (C - 1)."""
    decisions = choices(np.repeat([0] * 6 + [1] * 14, 10), np.repeat(np.arange(20), 10))
    information = informed(BANDIT, decisions)
    meat = sc.clustered_outer_product(BANDIT, information, decisions)
    by_cluster = sc.standard_errors(BANDIT, information, meat=meat).reward[0]
    plain = sc.standard_errors(BANDIT, information).reward[0]
    assert by_cluster / plain == pytest.approx(np.sqrt(10 * 20 / 19), rel=1e-6)
    others = sc.fit_information(BANDIT, choices([0, 0]), fitted(BANDIT, decisions))
    for given, seen, clusters, sentence in (
        (information, decisions, np.zeros(200, int), "clusters must be at least 2, got 1"),
        (information, decisions.with_hidden_actions(), None, "decisions must show their actions"),
        (others, decisions, None, "must be those of the information, got decision 60"),
    ):
        with pytest.raises(sc.SerdError, match=sentence):
            sc.clustered_outer_product(BANDIT, given, seen, clusters)


def test_a_bootstrap_of_a_mean_has_its_error_and_keeps_episodes_whole():
    decisions = choices(np.repeat([0] * 60 + [1] * 140, 5), np.repeat(np.arange(200), 5))
    rng = np.random.default_rng(0)
    found = sc.bootstrap(decisions, lambda sample: sample.action.mean(), rng=rng, n=400)
    assert found.standard_errors == pytest.approx(np.sqrt(0.7 * 0.3 / 200), rel=0.1)
    low, high = found.interval(0.9)
    assert high - low == pytest.approx(2 * 1.645 * found.standard_errors, rel=0.1)
    counted = []

    def estimate(sample):
        counted.append(sample)
        return np.array([0.0, np.nan if len(counted) == 3 else 1.0])

    with pytest.raises(sc.SerdError, match="got NaN for sample 2 of 5"):
        sc.bootstrap(decisions, estimate, rng=rng, n=5)
    with pytest.raises(sc.SerdError, match="must hold at least 2 episodes, got 1"):
        sc.bootstrap(decisions.select_episodes([0]), estimate, rng=rng)


#: Two states of choice that follow each other; x, y: features of choosing a in either.
CHOSEN = np.zeros((2, 2, 2))
CHOSEN[0, 0, 0] = CHOSEN[1, 0, 1] = 1.0
ONWARD = np.stack([np.eye(2)[[1, 0]]] * 2, axis=1)
NARROW, WIDE = (
    sc.from_transitions(ONWARD, CHOSEN[:, :, : len(names)], discount=0.5, feature_names=names)
    for names in (("x",), ("x", "y"))
)


def alternate(rng, n, p_second):
    action = np.where(np.arange(n) % 2 == 0, rng.random(n) < 0.4, rng.random(n) < p_second)
    state = np.arange(n) % 2
    return sc.Decisions(np.arange(n) // 2, np.arange(n) % 2, state, action.astype(int), 1 - state)


def test_the_likelihood_ratio_of_a_coin_is_its_closed_form():
    """y = 0 means a fair coin in the second state: G = 2 n KL."""
    decisions = alternate(np.random.default_rng(3), 400, 0.6)
    share = decisions.action[1::2].mean()
    ratio = sc.likelihood_ratio_test(fitted(NARROW, decisions), fitted(WIDE, decisions))
    entropy = share * np.log(2 * share) + (1 - share) * np.log(2 * (1 - share))
    assert ratio.statistic == pytest.approx(2 * 200 * entropy, rel=1e-5)
    assert ratio.degrees_of_freedom == 1
    assert ratio.p_value == pytest.approx(scipy.stats.chi2.sf(ratio.statistic, 1))


def random_problem(seed, scale=1.0):
    rng = np.random.default_rng(seed)
    table, features = rng.dirichlet(np.ones(5), size=(5, 3)), scale * rng.normal(size=(5, 3, 2))
    problem = sc.from_transitions(table, features, discount=0.9)
    policy = sc.soft_policy(problem, np.array([1.0, -0.7]) / scale).probabilities
    return problem, sc.sample_decisions(problem.mdp, policy, n_episodes=40, n_steps=10, rng=rng)


def test_policy_matching_alone_does_not_determine_the_scale_of_rewards():
    problem, decisions = random_problem(0)
    held = sc.GaussianPrior(0.1, sc.Block.POLICY, 1.0)
    for prior, known in ((sc.UniformPrior(), False), (held, True)):
        information = informed(problem, decisions, fit=sc.fit_pm_serd, prior=prior)
        errors = sc.standard_errors(problem, information).reward
        assert np.isfinite(errors).all() if known else np.isinf(errors).all()


@pytest.mark.parametrize("scale", [1e-6, 1e6])
@pytest.mark.parametrize(
    "fit",
    [
        sc.fit_mdce_irl_by_likelihood,
        sc.fit_mdce_irl_by_entropy,
        sc.fit_maxent_irl,
        sc.fit_policy_matching,
    ],
)
def test_units_of_features_change_no_fit(fit, scale):
    (problem, decisions), (other, same) = random_problem(1), random_problem(1, scale)
    wanted, found = fitted(problem, decisions, fit=fit), fitted(other, same, fit=fit)
    assert found.converged, found.message
    np.testing.assert_allclose(found.reward_weights * scale, wanted.reward_weights, atol=1e-3)


def test_tests_of_likelihoods_refuse_what_is_not_nested_or_not_by_likelihood():
    decisions = alternate(np.random.default_rng(3), 400, 0.6)
    restricted, full = fitted(NARROW, decisions), fitted(WIDE, decisions)
    fewer = fitted(NARROW, decisions.select(np.arange(398)))
    with_prior = fitted(NARROW, decisions, prior=sc.GaussianPrior(1.0, sc.Block.REWARD))
    other = fitted(NARROW, decisions, fit=sc.fit_maxent_irl)
    for less, more, number, sentence in (
        (with_prior, full, None, "must have fits that converged without a prior"),
        (full, restricted, None, "n_restrictions must be at least 1, got -1"),
        (fewer, full, None, "same decisions, got 398 and 400 decisions"),
        (full, restricted, 1, r"full must be at least as likely .* a gain of -"),
        (replace(restricted, assumptions=None), full, None, "the fit must record what it assumed"),
        (other, full, None, "by another criterion; use fit_mdce_irl_by_likelihood"),
    ):
        with pytest.raises(sc.SerdError, match=sentence):
            sc.likelihood_ratio_test(less, more, n_restrictions=number)
