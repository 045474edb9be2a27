"""Arrival in seconds: the thesis's as a special case, convolution by brute force, conditioning."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import ks_2samp

from serd_core.arrival.chain import ArrivalTimes
from serd_core.arrival.law import (
    ArrivalLaw,
    entry_times_s,
    largest_gap,
    law_in_seconds,
    steps_within,
)
from serd_core.errors import SerdError


def counted(probabilities, ever=None):
    """An arrival in n periods with probabilities[n]."""
    cdf = np.cumsum(probabilities)
    return ArrivalTimes(np.arange(len(cdf)), cdf, float(cdf[-1] if ever is None else ever))


@st.composite
def arrivals(draw):
    """Counted arrivals that may fail, and entry times in a period of 2 s."""
    rng = np.random.default_rng(draw(st.integers(0, 10_000)))
    weights = rng.dirichlet(np.ones(draw(st.integers(2, 12))))
    never = draw(st.floats(0.0, 0.5))
    entries = draw(st.lists(st.floats(0.05, 2.0), max_size=6))
    return counted((1 - never) * weights), tuple(entries)


def test_without_entry_times_arrivals_are_at_the_ends_of_periods_as_in_the_thesis():
    law = law_in_seconds(counted([0.0, 0.5, 0.25]), period_s=2.0)
    assert law.times_s.tolist() == [0, 2, 4]
    assert law.probability_by([1.99, 2.0, 3.99, 4.0]).tolist() == [0, 0.5, 0.5, 0.75]
    assert law.arrival_probability == 0.75


def test_entry_times_spread_each_arrival_evenly_over_the_gaps_between_them():
    law = law_in_seconds(counted([0.0, 0.4, 0.6]), period_s=2.0, entry_times_s=(1.5, 0.5))
    asked = [0.25, 0.5, 1.0, 1.5, 1.75, 2.0, 2.5, 3.5, 4.0]
    shares = np.array([1 / 6, 1 / 3, 1 / 2, 2 / 3, 5 / 6, 1, 4 / 3, 5 / 3, 2])
    expected = np.where(shares <= 1, 0.4 * shares, 0.4 + 0.6 * (shares - 1))
    np.testing.assert_allclose(law.probability_by(asked), expected)
    within_s = np.arange(0.05, 2.01, 0.05)
    np.testing.assert_allclose(law.times_s, [0.0, *within_s, *(2.0 + within_s)])
    law = law_in_seconds(counted([0.0, 1.0]), period_s=2.0, entry_times_s=(1.0, 1.0, 1.0))
    np.testing.assert_allclose(law.probability_by([0.999, 1.0, 2.0]), [0.2375, 0.75, 1.0])


def test_entries_not_seen_fall_beyond_the_seen_ones_as_often_as_hill_states():
    """Of 5 entries and a sixth from one distribution, the sixth is the earliest once in 6 times."""
    rng = np.random.default_rng(0)
    level = []
    for sample in rng.beta(30.0, 25.0, size=(2000, 6)) * 2.0:
        law = law_in_seconds(counted([0.0, 1.0]), period_s=2.0, entry_times_s=sample[:5])
        # Between steps of 0.05 s the law is a straight line.
        level.append(np.interp(sample[5], law.times_s, law.cdf))
    shares = np.bincount((np.array(level) * 6.0).astype(int), minlength=6) / 2000
    np.testing.assert_allclose(shares, 1 / 6, atol=4 * np.sqrt(5 / 36 / 2000))


@settings(deadline=None, max_examples=20)
@given(arrivals(), st.integers(0, 1000))
def test_drawn_arrivals_follow_the_law(case, seed):
    """A period by its probability, one of the gaps between entries, and a time within it."""
    arrival, entries = case
    rng = np.random.default_rng(seed)
    mass = np.diff(arrival.cdf, prepend=0.0)
    periods = rng.choice(len(mass) + 1, size=4000, p=np.append(mass, max(0, 1 - mass.sum())))
    ends_s = np.sort([0.0, *entries, 2.0])
    gap = rng.integers(len(entries) + 1, size=4000)
    entry_s = rng.uniform(ends_s[gap], ends_s[gap + 1]) if entries else np.full(4000, 2.0)
    times_s = np.where(periods == 0, 0.0, 2.0 * (periods - 1) + entry_s)
    times_s[periods == len(mass)] = np.inf
    law = law_in_seconds(arrival, period_s=2.0, entry_times_s=entries)
    measured = (times_s[:, None] <= law.times_s + 1e-9).mean(axis=0)
    # Dvoretzky-Kiefer-Wolfowitz: exceeded once in 10^6. Both sides take times within 1e-9 as equal.
    predicted = law.probability_by(law.times_s)
    assert np.abs(measured - predicted).max() < np.sqrt(np.log(2e6) / 8000)


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
    times_s, counts = np.unique(predicted, return_counts=True)
    law = ArrivalLaw(np.append(0.0, times_s), np.append(0.0, np.cumsum(counts) / 40), 1.0)
    within = measured[measured <= times_s[-1]]
    expected = ks_2samp(predicted, measured).statistic
    if len(within) == len(measured):
        assert largest_gap(law, measured) == pytest.approx(expected)


def test_entry_times_are_what_exceeds_the_whole_periods_before():
    np.testing.assert_allclose(entry_times_s([0.5, 2.0, 51.05, 4.0], 2.0), [0.5, 2.0, 1.05, 2.0])


def test_entry_times_stay_within_the_period_where_arrivals_miss_its_ends_by_rounding():
    """Within 1e-9 of the length of a period, an arrival belongs to the period that ends there."""
    for period_s in (0.5, 2.0):
        given = np.array([1e-10, 1.0 + 5e-10, 3.0 + 5e-10, 1.0 + 5e-9, 1.0 - 5e-10]) * period_s
        entry_s = entry_times_s(given, period_s) / period_s
        assert entry_s[1:3].tolist() == [1.0, 1.0]
        np.testing.assert_allclose(entry_s[[0, 3, 4]], [1e-10, 5e-9, 1.0 - 5e-10], rtol=1e-6)


def test_the_largest_gap_counts_arrivals_between_the_last_two_steps_and_no_later_one():
    law = ArrivalLaw(np.array([0.0, 1.0, 10.0]), np.array([0.0, 0.4, 1.0]), 1.0)
    # At 5 s all measured robots have arrived, of the law's 40 %.
    assert largest_gap(law, [5, 5, 5]) == pytest.approx(0.6)
    early = ArrivalLaw(np.array([0.0, 1.0]), np.array([0.0, 0.4]), 0.4)
    # After the last step nothing is compared.
    assert largest_gap(early, [2.0, 3.0]) == pytest.approx(0.4)
    # One of two never arrives.
    assert largest_gap(ArrivalLaw(law.times_s, law.cdf, 1.0), [1.0, np.inf]) == pytest.approx(0.5)
    at_the_goal = law_in_seconds(counted([0.75], ever=1.0), period_s=2.0)
    assert largest_gap(at_the_goal, [0.0, 3.0]) == pytest.approx(0.25)


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


def test_each_draw_of_a_posterior_has_the_law_of_its_own_arrival():
    each = [counted([0.0, 0.4, 0.6]), counted([0.1, 0.2, 0.3]), counted([0.0, 0.0, 0.5])]
    given = {"period_s": 2.0, "entry_times_s": (1.5, 0.5)}
    law = law_in_seconds(ArrivalTimes.average(each), **given)
    alone = np.stack([law_in_seconds(one, **given).cdf for one in each])
    np.testing.assert_allclose(law.cdf_draws, alone)
    np.testing.assert_allclose(law.cdf, alone.mean(axis=0))
    assert law_in_seconds(each[0], **given).cdf_draws is None


def of_one(*entry_times_s, period_s=2.0):
    """A law of who arrives in the first period."""
    return law_in_seconds(counted([0.0, 1.0]), period_s=period_s, entry_times_s=entry_times_s)


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: of_one(period_s=np.nan), "^period_s must be above 0 and finite, got nan"),
        (lambda: entry_times_s([1.0], 0.0), "^period_s must be above 0 and finite, got 0.0"),
        (lambda: entry_times_s([[1.0]], 2.0), "^arrival_times_s must "),
        (lambda: entry_times_s([3.0, 0.0], 2.0), r"^arrival_times_s\[1\] must be above 0, got"),
        (lambda: entry_times_s([3.0, -1.0], 2.0), r"^arrival_times_s\[1\] must be above 0, got"),
        (lambda: of_one([1.0]), "^entry_times_s must "),
        (lambda: of_one(1.0, 2.5), r"^entry_times_s\[1\] must be above 0 and at most .* got 2.5"),
        (lambda: of_one(1.0, 0.0), r"^entry_times_s\[1\] must be above 0 and at most .* got 0.0"),
        (lambda: largest_gap(of_one(), []), "^arrival_times_s must hold at least one time"),
        (lambda: largest_gap(of_one(), [1.0, np.nan]), "^arrival_times_s must .* no NaN"),
    ],
)
def test_wrong_arguments_are_refused_by_name(call, sentence):
    with pytest.raises(SerdError, match=sentence):
        call()
