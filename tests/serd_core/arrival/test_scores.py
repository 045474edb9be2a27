"""Scores of laws of arrival, and the test with its power."""

import numpy as np
import pytest
from scipy.stats import binom, expon, gamma

from serd_core.arrival.law import ArrivalLaw, crps_s, detectable_delay, gap_probability, largest_gap
from serd_core.errors import SerdError

STEP_S = 0.1


def gamma_law(mean_s=20.0, shape=40.0, arriving=1.0):
    times_s = STEP_S * np.arange(601)
    return ArrivalLaw(times_s, arriving * gamma(shape, scale=mean_s / shape).cdf(times_s), arriving)


def drawn(law, n, seed):
    place = np.searchsorted(law.cdf, np.random.default_rng(seed).random(n), side="right")
    return np.append(law.times_s, np.inf)[np.minimum(place, len(law.times_s))]


def test_the_score_is_the_integral_of_the_squared_difference_of_both_functions():
    law = ArrivalLaw(np.array([0.0, 1.0, 10.0]), np.array([0.0, 0.4, 1.0]), 1.0)
    assert crps_s(law, [5.0]) == pytest.approx(4 * 0.4**2 + 5 * 0.6**2)
    assert crps_s(law, [0.5, np.inf]) == pytest.approx((0.5 + 9 * 0.6**2 + 9 * 0.4**2) / 2)


def test_the_score_is_proper():
    truth = gamma_law()
    measured = drawn(truth, 4000, 3)
    right = crps_s(truth, measured)
    for wrong in (gamma_law(mean_s=22.0), gamma_law(shape=160.0), gamma_law(shape=10.0)):
        assert crps_s(wrong, measured) > right + 0.02


def test_an_exponential_law_has_its_closed_score():
    times_s = 0.01 * np.arange(4001)
    law = ArrivalLaw(times_s, expon(scale=2.0).cdf(times_s), 1.0)
    # CRPS of an exponential law of mean m at t: t - 2 m (1 - exp(-t / m)) + m / 2.
    assert crps_s(law, [3.0]) == pytest.approx(3.0 - 4.0 * (1 - np.exp(-1.5)) + 1.0, abs=0.01)


def test_probabilities_of_gaps_are_even_where_the_law_is_right_also_where_some_never_arrive():
    for arriving in (1.0, 0.7):
        law = gamma_law(arriving=arriving)
        levels = [gap_probability(law, drawn(law, 15, seed)) for seed in range(200)]
        # Binomial, at 4 standard deviations.
        for level in (0.1, 0.5):
            spread = np.sqrt(level * (1 - level) / 200)
            assert abs(np.mean(np.array(levels) <= level) - level) < 4 * spread


def test_a_delay_that_is_detectable_is_detected_in_four_of_five_series():
    law, n = gamma_law(), 20
    delay = detectable_delay(law, n)
    assert 1.02 < delay < 1.3
    found = [gap_probability(law, delay * drawn(law, n, 100 + seed)) <= 0.05 for seed in range(200)]
    assert abs(np.mean(found) - 0.8) < 0.15
    assert detectable_delay(law, 200) < delay


def test_a_world_that_is_one_of_the_draws_of_a_posterior_is_not_called_wrong():
    """The mean of two draws is no law of either."""
    worlds = gamma_law(), gamma_law(mean_s=30.0)
    draws = np.stack([each.cdf for each in worlds])
    mean = ArrivalLaw(worlds[0].times_s, draws.mean(axis=0), 1.0, draws)
    levels = [gap_probability(mean, drawn(worlds[seed % 2], 30, seed)) for seed in range(100)]
    assert np.sum(np.array(levels) <= 0.05) <= binom.isf(1e-5, 100, 0.05)
    alone = ArrivalLaw(mean.times_s, mean.cdf, 1.0)
    levels = [gap_probability(alone, drawn(worlds[seed % 2], 30, seed)) for seed in range(20)]
    assert max(levels) < 0.01


@pytest.mark.parametrize("score", [crps_s, gap_probability, largest_gap])
@pytest.mark.parametrize("times_s", [[], [1.0, np.nan]])
def test_series_without_a_time_are_refused(score, times_s):
    with pytest.raises(SerdError, match="arrival_times_s must hold at least one time and no NaN"):
        score(gamma_law(), times_s)
