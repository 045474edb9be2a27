"""Arrival curves: the step functions behind the CDF figure and the summary."""

import numpy as np

from serd_app.report.figures.arrival import (
    ArrivalCurve,
    at_times,
    measured_curve,
    predicted_curve,
    shown_from_s,
    shown_until_s,
    time_reaching,
)
from serd_core.arrival.law import ArrivalLaw


def curve(times: list[float], shares: list[float]) -> ArrivalCurve:
    share = np.array(shares)
    return ArrivalCurve(np.array(times), share, share, share)


def test_the_measured_curve_counts_who_never_arrived() -> None:
    measured = measured_curve([3.0, 5.0, np.inf, 5.0], 60.0)
    assert at_times(measured, np.array([2.9, 3.0, 5.0, 60.0])).probability.tolist() == [
        0.0,
        0.25,
        0.75,
        0.75,
    ]
    assert (measured.lower <= measured.probability).all()
    assert (measured.upper >= measured.probability).all()


def test_the_predicted_band_narrows_with_the_number_of_episodes() -> None:
    predicted = ArrivalLaw(2.0 * np.arange(4), np.array([0.0, 0.2, 0.6, 0.9]), 1.0)
    few, many = predicted_curve(predicted, 10), predicted_curve(predicted, 1000)
    assert few.time_s.tolist() == [0.0, 2.0, 4.0, 6.0]
    assert (many.upper - many.lower)[1:].max() < (few.upper - few.lower)[1:].min()


def test_the_time_axis_ends_where_both_curves_have_settled() -> None:
    predicted = ArrivalLaw(2.0 * np.arange(4), np.array([0.0, 0.2, 0.6, 0.9]), 1.0)
    assert shown_until_s(predicted, [3.0, 5.0], 60.0) == 1.15 * 6.0
    assert shown_until_s(predicted, [3.0, 9.0], 60.0) == 1.15 * 9.0
    assert shown_until_s(predicted, [3.0, np.inf], 60.0) == 60.0
    assert shown_until_s(predicted, [3.0, 9.0], 10.0) == 10.0


def test_a_share_that_is_never_reached_has_no_time() -> None:
    assert time_reaching(curve([0.0, 1.0], [0.0, 0.4]), 0.5) is None
    assert time_reaching(curve([0.0, 1.0], [0.0, 0.5]), 0.5) == 1.0


def test_the_axis_begins_shortly_before_the_first_curve_leaves_zero():
    times = [0.0, 20.0, 30.0, 40.0]
    early, late = curve(times, [0.0, 0.1, 0.5, 1.0]), curve(times, [0.0, 0.001, 0.5, 1.0])
    assert shown_from_s(early, late) == 0.9 * 20.0
    assert shown_from_s(late) == 0.9 * 30.0
    assert shown_from_s(curve(times, [0.0] * 4)) == 0.0
