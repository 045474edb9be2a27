"""Empirical CDFs and their bands against closed forms and sums of binomial probabilities."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binom

from serd_core.arrival.law import clopper_pearson, empirical_arrival_cdf, sampling_band
from serd_core.errors import SerdError


def test_the_empirical_cdf_counts_time_outs_as_not_arrived():
    measured = empirical_arrival_cdf([3.0, 1.0, 3.0, 99.0], [False, False, False, True], 10.0)
    np.testing.assert_allclose(measured.times_s, [0, 1, 3, 10])
    np.testing.assert_allclose(measured.cdf, [0, 0.25, 0.75, 0.75])
    for not_read in (None, np.nan, -1.0, 0.5):
        measured = empirical_arrival_cdf([3.0, 1.0, 3.0, not_read], [False] * 3 + [True], 10.0)
        np.testing.assert_allclose(measured.cdf, [0, 0.25, 0.75, 0.75])
    assert (measured.n_arrived, measured.n_episodes) == (3, 4)
    # One starts at the goal, one arrives at the horizon, one after it.
    measured = empirical_arrival_cdf([0.0, 0.5, 4.0, 4.5], [False] * 4, 4.0, coverage=0.8)
    np.testing.assert_allclose(measured.cdf, [0.25, 0.5, 0.75])
    lower, upper = clopper_pearson([1, 2, 3], 4, coverage=0.8)
    np.testing.assert_allclose([measured.lower, measured.upper], [lower, upper])


def test_clopper_pearson_has_its_closed_form_at_the_ends():
    lower, upper = clopper_pearson([0, 10], 10)
    assert lower[0] == 0
    assert upper[0] == pytest.approx(1 - 0.025 ** (1 / 10))
    assert upper[1] == 1
    assert lower[1] == pytest.approx(0.025 ** (1 / 10))


@settings(deadline=None, max_examples=30)
@given(st.integers(1, 60), st.floats(0.01, 0.99))
def test_the_exact_interval_covers_at_least_as_often_as_it_says(n_trials, probability):
    counts = np.arange(n_trials + 1)
    lower, upper = clopper_pearson(counts, n_trials)
    covered = (lower <= probability) & (probability <= upper)
    assert binom.pmf(counts, n_trials, probability)[covered].sum() >= 0.95 - 1e-9


def test_the_sampling_band_of_a_posterior_holds_counts_of_its_mixture_of_binomials():
    draws = np.random.default_rng(4).beta(20.0, [[4.0, 20.0, 0.5]], size=(50, 3))
    n_episodes, counts = 60, np.arange(61)
    lower, upper = sampling_band(draws, n_episodes)
    mixture = binom.pmf(counts[:, None, None], n_episodes, draws).mean(axis=1)
    inside = (counts[:, None] >= n_episodes * lower) & (counts[:, None] <= n_episodes * upper)
    covered = np.where(inside, mixture, 0.0).sum(axis=0)
    assert np.all(covered >= 0.95)
    ends = [mixture[: round(60 * low) + 1, t].sum() for t, low in enumerate(lower)]
    assert np.all(np.array(ends) >= 0.025)
    narrow = sampling_band(draws.mean(axis=0), n_episodes)
    assert np.all(upper - lower >= narrow[1] - narrow[0])
    assert upper[1] - lower[1] > 1.2 * (narrow[1] - narrow[0])[1]


@pytest.mark.parametrize("n_trials", [2, 10])
def test_the_ends_of_the_exact_interval_leave_half_of_the_rest_on_each_side(n_trials):
    counts = np.arange(1, n_trials)
    lower, upper = clopper_pearson(counts, n_trials, coverage=0.8)
    np.testing.assert_allclose(binom.sf(counts - 1, n_trials, lower), 0.1)
    np.testing.assert_allclose(binom.cdf(counts, n_trials, upper), 0.1)


def test_the_sampling_band_has_the_quantiles_of_the_binomial_distribution():
    probability = np.array([0.03, 0.3, 0.5, 0.97, 1.0, 0.0])
    for n_episodes in (1, 2, 7, 40):
        for coverage in (0.5, 0.8, 0.95):
            tail = (1.0 - coverage) / 2.0
            lower, upper = sampling_band(probability, n_episodes, coverage)
            wanted = [binom.ppf(share, n_episodes, probability) for share in (tail, 1.0 - tail)]
            np.testing.assert_allclose(lower * n_episodes, np.maximum(wanted[0], 0.0))
            np.testing.assert_allclose(upper * n_episodes, np.maximum(wanted[1], 0.0))
    # Of two episodes at 1/2 none arrives with probability 1/4, and at most one with 3/4.
    assert sampling_band(0.5, 2, coverage=0.5) == (0.0, 0.5)


def test_sums_of_probabilities_may_pass_zero_and_one_by_rounding():
    lower, upper = sampling_band([-1e-9, 1.0 + 1e-9], 7)
    assert lower.tolist() == upper.tolist() == [0.0, 1.0]
    lower, upper = sampling_band([[-1e-9], [1.0]], 7)
    assert (lower.tolist(), upper.tolist()) == ([0.0], [1.0])


@pytest.mark.parametrize("times_s", [[], [np.nan], [-1.0]])
def test_times_that_are_none_are_refused(times_s):
    with pytest.raises(SerdError, match="times_s must hold at least one episode, and no NaN or ne"):
        empirical_arrival_cdf(times_s, np.zeros(len(times_s), bool), 10.0)
