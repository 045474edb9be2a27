"""Laws of arrival in seconds, and their largest gap to measured times."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binom, gamma, ks_2samp

import serd_core as sc
from serd_core.arrival import law as laws
from serd_core.arrival.law import ArrivalLaw, clopper_pearson, largest_gap, sampling_band
from support.refusals import refusals


def test_the_quantile_is_the_first_time_by_which_that_share_has_arrived():
    law = ArrivalLaw(np.array([0.0, 1.0, 3.0]), np.array([0.0, 0.4, 0.8]), 0.9)
    assert law.quantile_s(0.4) == 1.0
    assert law.quantile_s(0.41) == 3.0
    assert law.quantile_s(0.81) is None
    certain = ArrivalLaw(np.array([0.0, 1.0, 2.0]), np.array([0.0, 0.5, 1.0]), 1.0)
    assert (certain.quantile_s(0.5), certain.quantile_s(1.0)) == (1.0, 2.0)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10_000))
def test_the_largest_gap_is_the_kolmogorov_smirnov_statistic(seed):
    """Against scipy's two-sample statistic, with the law as a sample of its step times."""
    rng = np.random.default_rng(seed)
    predicted = np.sort(rng.choice(np.arange(1, 60) / 4, size=40))
    measured = rng.choice(np.arange(1, 60) / 4, size=25)
    times_s = np.arange(60) / 4
    shares = np.searchsorted(predicted, times_s, side="right") / len(predicted)
    law = ArrivalLaw(times_s, shares, 1.0)
    assert largest_gap(law, measured) == pytest.approx(ks_2samp(predicted, measured).statistic)
    rounded = measured + rng.uniform(-0.1, 0.1, len(measured))
    assert largest_gap(law, rounded) == pytest.approx(largest_gap(law, measured))


def test_steps_within_a_time_are_the_fewest_that_last_as_long_up_to_rounding():
    asked = [(0.0, 2.0, 0), (4.0, 2.0, 2), (4.1, 2.0, 3), (0.3, 0.1, 3), (0.7, 0.1, 7)]
    for time_s, step_s, n_steps in asked:
        assert laws.steps_within(time_s, step_s) == n_steps


def test_a_delayed_law_has_the_same_steps_later_and_nothing_before():
    draws = np.array([[0.0, 0.4], [0.2, 0.6]])
    law = ArrivalLaw(np.array([0.0, 1.0]), np.array([0.1, 0.5]), 0.9, draws)
    later = law.delayed(3.0)
    assert later.probability_by([2.9, 3.0, 3.9, 4.0]).tolist() == [0.0, 0.1, 0.1, 0.5]
    assert later.quantile_s(0.5) == 4.0
    assert later.arrival_probability == 0.9
    np.testing.assert_array_equal(later.cdf_draws, draws)


@pytest.mark.parametrize(
    ("times_s", "cdf", "measured_s", "gap"),
    [
        ([0.0, 1.0, 10.0], [0.0, 0.4, 1.0], [5, 5, 5], 0.6),  # at 5 s all, of the law's 40 %
        ([0.0, 1.0], [0.0, 0.4], [2.0, 3.0], 0.4),  # after the last step nothing is compared
        ([0.0, 1.0, 10.0], [0.0, 0.4, 1.0], [1.0, np.inf], 0.5),  # one of two never arrives
        ([0.0], [0.75], [0.0, 3.0], 0.25),
    ],
)
def test_the_largest_gap_counts_arrivals_up_to_the_last_step(times_s, cdf, measured_s, gap):
    law = ArrivalLaw(np.array(times_s), np.array(cdf), 1.0)
    assert largest_gap(law, measured_s) == pytest.approx(gap)


def test_the_empirical_cdf_counts_time_outs_as_not_arrived():
    measured = laws.empirical_arrival_cdf([3.0, 1.0, 3.0, 99.0], [False, False, False, True], 10.0)
    np.testing.assert_allclose(measured.times_s, [0, 1, 3, 10])
    np.testing.assert_allclose(measured.cdf, [0, 0.25, 0.75, 0.75])
    for not_read in (None, np.nan, -1.0, 0.5):
        measured = laws.empirical_arrival_cdf([3.0, 1.0, 3.0, not_read], [False] * 3 + [True], 10.0)
        np.testing.assert_allclose(measured.cdf, [0, 0.25, 0.75, 0.75])
    assert (measured.n_arrived, measured.n_episodes) == (3, 4)
    # One starts at the goal, one arrives at the horizon, one after it.
    measured = laws.empirical_arrival_cdf([0.0, 0.5, 4.0, 4.5], [False] * 4, 4.0, coverage=0.8)
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


STEP_S = 0.1


def gamma_law(mean_s=20.0, shape=40.0, arriving=1.0):
    times_s = STEP_S * np.arange(601)
    return ArrivalLaw(times_s, arriving * gamma(shape, scale=mean_s / shape).cdf(times_s), arriving)


def drawn(law, n, seed):
    place = np.searchsorted(law.cdf, np.random.default_rng(seed).random(n), side="right")
    return np.append(law.times_s, np.inf)[np.minimum(place, len(law.times_s))]


def test_the_score_is_the_integral_of_the_squared_difference_of_both_functions():
    law = ArrivalLaw(np.array([0.0, 1.0, 10.0]), np.array([0.0, 0.4, 1.0]), 1.0)
    assert sc.crps_s(law, [5.0]) == pytest.approx(4 * 0.4**2 + 5 * 0.6**2)
    assert sc.crps_s(law, [0.5, np.inf]) == pytest.approx((0.5 + 9 * 0.6**2 + 9 * 0.4**2) / 2)


def test_probabilities_of_gaps_are_even_where_the_law_is_right_also_where_some_never_arrive():
    for arriving in (1.0, 0.7):
        law = gamma_law(arriving=arriving)
        levels = [sc.gap_probability(law, drawn(law, 15, seed)) for seed in range(200)]
        # Binomial, at 4 standard deviations.
        for level in (0.1, 0.5):
            spread = np.sqrt(level * (1 - level) / 200)
            assert abs(np.mean(np.array(levels) <= level) - level) < 4 * spread


def test_a_delay_that_is_detectable_is_detected_in_four_of_five_series():
    law, n = gamma_law(), 20
    delay = sc.detectable_delay(law, n)
    assert 1.02 < delay < 1.3
    found = [
        sc.gap_probability(law, delay * drawn(law, n, 100 + seed)) <= 0.05 for seed in range(200)
    ]
    assert abs(np.mean(found) - 0.8) < 0.15
    assert sc.detectable_delay(law, 200) < delay


def test_a_world_that_is_one_of_the_draws_of_a_posterior_is_not_called_wrong():
    """The mean of two draws is no law of either."""
    worlds = gamma_law(), gamma_law(mean_s=30.0)
    draws = np.stack([each.cdf for each in worlds])
    mean = ArrivalLaw(worlds[0].times_s, draws.mean(axis=0), 1.0, draws)
    levels = [sc.gap_probability(mean, drawn(worlds[seed % 2], 30, seed)) for seed in range(100)]
    assert np.sum(np.array(levels) <= 0.05) <= binom.isf(1e-5, 100, 0.05)
    alone = ArrivalLaw(mean.times_s, mean.cdf, 1.0)
    levels = [sc.gap_probability(alone, drawn(worlds[seed % 2], 30, seed)) for seed in range(20)]
    assert max(levels) < 0.01


def measured(times_s):
    return lambda: laws.empirical_arrival_cdf(times_s, np.zeros(len(times_s), bool), 10.0)


NO_TIME = "arrival_times_s must hold at least one time and no NaN"
test_series_without_times_are_refused = refusals(
    *((measured(each), "at least one episode, and no NaN or ne") for each in ([], [np.nan], [-1])),
    (lambda: sc.crps_s(gamma_law(), []), NO_TIME),
    (lambda: sc.gap_probability(gamma_law(), [1.0, np.nan]), NO_TIME),
    (lambda: largest_gap(gamma_law(), []), NO_TIME),
)
