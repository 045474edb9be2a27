"""Laws of arrival in seconds, and their largest gap to measured times."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import ks_2samp

from serd_core.arrival.law import ArrivalLaw, largest_gap, steps_within


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
        assert steps_within(time_s, step_s) == n_steps


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
