import numpy as np
import pytest
from scipy.stats import kstest

from lab.experiments.study.people.pace_ahead import fit_pace_ahead
from lab.experiments.study.people.scores import (
    crps_s,
    integral_transform,
    point_law,
    scaled_point_law,
)
from serd_core.arrival.dwell_times import Pace
from serd_core.arrival.law import ArrivalLaw


def test_the_score_of_a_point_is_its_absolute_error():
    assert crps_s(point_law(4.0), 5.5) == pytest.approx(1.5)
    assert crps_s(point_law(4.0), 3.0) == pytest.approx(1.0)


def test_the_score_of_a_uniform_forecast_is_that_of_its_closed_form():
    times = np.linspace(0, 1, 2001)
    found = crps_s(ArrivalLaw(times, times, 1.0), 0.3)
    assert found == pytest.approx(0.3**3 / 3 + 0.7**3 / 3, abs=1e-3)


def test_intervals_hold_their_share_of_times_that_follow_the_forecast():
    rng = np.random.default_rng(5)
    law = scaled_point_law(10.0, rng.lognormal(0, 0.3, 4000))
    drawn = 10.0 * rng.lognormal(0, 0.3, 2000)
    transformed = np.array([integral_transform(law, each) for each in drawn])
    assert np.mean(np.abs(transformed - 0.5) <= 0.45) == pytest.approx(0.9, abs=0.025)
    assert kstest(transformed, "uniform").pvalue > 1e-3


def test_one_outlier_among_the_factors_leaves_the_transform_as_it_is():
    factors = np.concatenate([np.linspace(0.9, 1.1, 99), [40.0]])
    law = scaled_point_law(10.0, factors)
    assert integral_transform(law, 8.0) == 0.0
    assert integral_transform(law, 10.9) == pytest.approx(0.94, abs=0.01)
    assert integral_transform(law, 50.0) == pytest.approx(0.99)
    assert integral_transform(point_law(4.0), 4.0) == 0.5


def test_the_pace_ahead_regresses_to_the_mean_as_much_as_people_change():
    rng = np.random.default_rng(4)
    observed = rng.normal(0, 0.2, 3000)
    noise = rng.uniform(0.001, 0.01, 3000)
    ahead = 0.05 + 0.6 * observed + rng.normal(0, np.sqrt(0.01 + noise))
    found = fit_pace_ahead(observed, ahead, noise)
    assert found.intercept == pytest.approx(0.05, abs=0.01)
    assert found.slope == pytest.approx(0.6, abs=0.03)
    assert found.variance == pytest.approx(0.01, rel=0.1)
    assert found.after(Pace(0.5, 1.0)).mean == pytest.approx(0.35, abs=0.03)
