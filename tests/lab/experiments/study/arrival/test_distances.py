import numpy as np
import pandas as pd
import pytest

from lab.experiments.study.arrival.distances import ArrivalTables, distance_row, ks_p_value
from lab.experiments.study.arrival.stage import measured_cdf

LONG_S = 2.0


def step_at(step, steps=20):
    return (np.arange(steps + 1) >= step).astype(float)


def tables(predicted, measured, n_episodes=10):
    return ArrivalTables(np.array(predicted), np.array(measured), n_episodes, LONG_S)


@pytest.fixture
def row_of(settings):
    return lambda found: distance_row(found, settings.statistics, np.random.default_rng(0))


def test_a_prediction_that_is_two_steps_late_is_four_seconds_off(row_of):
    row = row_of(tables([step_at(12)] * 3, [step_at(10)] * 3))
    assert row["ks"] == 1.0
    assert row["wasserstein_s"] == row["crps_s"] == 2 * LONG_S
    assert row["predicted_mean_s"] - row["measured_mean_s"] == pytest.approx(2 * LONG_S)
    assert row["arrival_error"] == 0.0
    assert row["ks_p_value"] < 0.01


def test_errors_that_cancel_out_are_seen_by_the_score_alone(row_of):
    row = row_of(tables([step_at(8), step_at(12)], [step_at(12), step_at(8)]))
    assert row["ks"] == 0.0
    assert row["crps_s"] == 4 * LONG_S


def test_wasserstein_up_to_the_limit_is_the_difference_of_means_where_all_is_late(row_of):
    measured = np.sort(np.random.default_rng(2).random((3, 21)))
    measured[:, -1] = 0.8
    late = tables(0.5 * measured, measured)
    row = row_of(late)
    # Who never arrives counts with the limit, 20 steps, in both means.
    assert row["wasserstein_s"] == pytest.approx(row["predicted_mean_s"] - row["measured_mean_s"])
    assert row["arrival_error"] == pytest.approx(-0.4)
    assert late.measured_means_s.mean() == pytest.approx(row["measured_mean_s"])


def test_the_score_is_that_of_its_definition_episode_by_episode():
    rng = np.random.default_rng(5)
    predicted = np.sort(rng.random(21))
    arrived = rng.integers(1, 30, size=6)
    measured = np.mean([step_at(each) for each in arrived], axis=0)
    gaps = [(predicted - step_at(each))[:-1] for each in arrived]
    expected = np.mean([LONG_S * (gap**2).sum() for gap in gaps])
    assert tables([predicted], [measured], 6).scores[0] == pytest.approx(expected)


def test_the_test_accepts_episodes_that_were_drawn_from_the_prediction():
    rng = np.random.default_rng(6)
    predicted = np.cumsum(np.full(21, 0.04))
    p_values = []
    for _ in range(40):
        shares = np.diff(predicted, prepend=0.0, append=1.0)
        counts = rng.multinomial(50, shares / shares.sum())[:-1]
        p_values.append(ks_p_value(tables([predicted], [counts.cumsum() / 50], 50), 200, rng))
    assert np.mean(np.array(p_values) < 0.05) < 0.15
    assert 0.3 < np.mean(p_values) < 0.7


def test_measured_times_are_rounded_to_whole_steps_and_what_never_arrived_stays_out():
    rows = pd.DataFrame({"arrived": [True, True, False, True], "time_s": [0.9, 1.1, 2.5, 2.3]})
    np.testing.assert_allclose(measured_cdf(rows, 5), [0, 0, 0.5, 0.5, 0.5, 0.75])
