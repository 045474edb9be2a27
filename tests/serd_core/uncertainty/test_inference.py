"""Clusters, bootstrap and likelihood ratio, by closed forms and simulation."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.stats

import serd_core as sc
from support.small_problems import gridworld_problem, gridworld_truth, sampled
from tests.serd_core.uncertainty.test_uncertainty import BANDIT, choices, fit_from_zero, informed


def test_clusters_of_equal_choices_count_as_one_choice():
    """Ten equal choices per episode: sqrt(10) times the error, with C / (C - 1)."""
    decisions = choices(np.repeat([0] * 6 + [1] * 14, 10), np.repeat(np.arange(20), 10))
    information = informed(BANDIT, decisions)
    meat = sc.clustered_outer_product(BANDIT, information, decisions)
    errors = sc.standard_errors(BANDIT, information, meat=meat)
    plain = sc.standard_errors(BANDIT, information)
    assert errors.reward / plain.reward == pytest.approx(np.sqrt(10 * 20 / 19), rel=1e-6)
    assert errors.covariance / plain.covariance == pytest.approx(10 * 20 / 19, rel=1e-6)
    for seen, clusters, sentence in (
        (decisions, np.zeros(200, int), "clusters must be a whole number of at least 2, got 1"),
        (decisions.with_hidden_actions(), None, "got 200 with 200 hidden actions"),
        (decisions.select(np.arange(50)), None, "must be those of the information"),
    ):
        with pytest.raises(sc.SerdError, match=sentence):
            sc.clustered_outer_product(BANDIT, information, seen, clusters)


def test_a_bootstrap_of_a_mean_has_its_error_and_keeps_episodes_whole():
    decisions = choices(np.repeat([0] * 60 + [1] * 140, 5), np.repeat(np.arange(200), 5))
    rng = np.random.default_rng(0)
    found = sc.bootstrap(decisions, lambda sample: sample.action.mean(), rng=rng, n=400)
    assert found.standard_errors == pytest.approx(np.sqrt(0.7 * 0.3 / 200), rel=0.1)
    low, high = found.interval(0.9)
    assert high - low == pytest.approx(2 * 1.645 * found.standard_errors, rel=0.1)
    counted = sc.bootstrap(decisions, lambda sample: len(sample.episodes), rng=rng, n=5)
    assert counted.estimates.tolist() == [200] * 5
    for seen, estimate, sentence in (
        (decisions, lambda _: [0.0, np.nan], r"returns\[0, 1\] must be a number for every"),
        (decisions, lambda _: "much", "what estimate returns must be an array of numbers"),
        (decisions.select_episodes([0]), len, "episodes must be a whole number of at least 2"),
    ):
        with pytest.raises(sc.SerdError, match=sentence):
            sc.bootstrap(seen, estimate, rng=rng)


#: Two states of choice that follow each other; x, y: features of choosing a in either.
CHOSEN = np.zeros((2, 2, 2))
CHOSEN[0, 0, 0] = CHOSEN[1, 0, 1] = 1.0
ONWARD = np.stack([np.eye(2)[[1, 0]]] * 2, axis=1)
NARROW, WIDE = (
    sc.from_transitions(ONWARD, CHOSEN[:, :, :number], discount=0.5) for number in (1, 2)
)


def test_the_likelihood_ratio_of_a_coin_is_its_closed_form():
    """y = 0 means a fair coin in the second state: G = 2 n KL."""
    rng, state = np.random.default_rng(3), np.arange(400) % 2
    action = np.where(state == 0, rng.random(400) < 0.4, rng.random(400) < 0.6).astype(int)
    decisions = sc.Decisions(np.arange(400) // 2, state, state, action, 1 - state)
    restricted, full = fit_from_zero(NARROW, decisions), fit_from_zero(WIDE, decisions)
    share = action[1::2].mean()
    entropy = share * np.log(2 * share) + (1 - share) * np.log(2 * (1 - share))
    ratio = sc.likelihood_ratio_test(restricted, full)
    assert ratio.statistic == pytest.approx(2 * 200 * entropy, rel=1e-5)
    assert ratio.degrees_of_freedom == 1
    assert ratio.p_value == pytest.approx(scipy.stats.chi2.sf(ratio.statistic, 1))
    assert sc.likelihood_ratio_test(restricted, full, 3).degrees_of_freedom == 3
    with_prior = fit_from_zero(NARROW, decisions, prior=sc.GaussianPrior(1.0, sc.Block.REWARD))
    for less, more, number, sentence in (
        (with_prior, full, None, "restricted must be a fit that converged .*GaussianPrior"),
        (restricted, replace(full, converged=False), None, "full must .* got converged=False"),
        (fit_from_zero(NARROW, decisions, fit=sc.fit_maxent_irl), full, None, "likelihood=False"),
        (full, restricted, None, "n_restrictions must be a whole number of at least 1, got -1"),
        (replace(restricted, n_decisions=398), full, None, "decisions, got 398 and 400 decisions"),
        (full, restricted, 1, r"full must be at least as likely .* a gain of -"),
        (replace(restricted, assumptions=None), full, None, "the fit must record what it assumed"),
    ):
        with pytest.raises(sc.SerdError, match=sentence):
            sc.likelihood_ratio_test(less, more, number)


def misspecified(kind):
    """(S, A) policy of somebody who takes the best action but for 30 %, or looks less far ahead."""
    world, weights = gridworld_problem(4, 0.9), np.array([2.0, 3.0])
    if kind == "wrong discount":
        hasty = gridworld_problem(4, 0.7)
        return world, sc.soft_policy(hasty, weights, gridworld_truth()).probabilities
    best = sc.optimal_policy(world, weights, gridworld_truth()).greedy
    return world, 0.7 * np.eye(5)[best] + 0.3 / 5


@pytest.mark.parametrize("kind", ["epsilon-greedy", "wrong discount"])
def test_the_sandwich_is_the_spread_of_weights_over_data_sets_of_experts_of_another_kind(kind):
    problem, policy = misspecified(kind)
    weights, sandwich, plain = [], [], []
    for seed in range(80):
        decisions = sampled(problem, policy, gridworld_truth(), 150, 12, seed)
        fit = sc.fit_mdce_irl_by_likelihood(
            problem, decisions, initial_weights=np.zeros(2), dynamics=gridworld_truth()
        )
        found = sc.fit_information(problem, decisions, fit)
        meat = sc.clustered_outer_product(problem, found, decisions)
        weights.append(fit.reward_weights)
        sandwich.append(sc.standard_errors(problem, found, meat=meat).reward)
        plain.append(sc.standard_errors(problem, found).reward)
    spread = np.std(weights, axis=0, ddof=1)
    # A standard deviation of 80 values has an error of 8 %.
    np.testing.assert_allclose(np.mean(sandwich, axis=0), spread, rtol=0.2)
    if kind == "epsilon-greedy":
        assert np.all(np.mean(plain, axis=0) < 0.7 * spread)
