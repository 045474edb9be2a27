"""Figures of arrivals carry the steps of their curves."""

import numpy as np

from serd_app.report.figures.arrival import (
    ArrivalCurve,
    draw_comparison,
    measured_curve,
    predicted_curve,
)
from serd_app.report.style import png_bytes
from serd_core.arrival.law import ArrivalLaw

LAW = ArrivalLaw(2.0 * np.arange(4), np.array([0.0, 0.2, 0.6, 0.9]), 1.0)


def test_the_arrival_figure_draws_both_curves_with_their_bands():
    times_s = [3.0, 5.0, np.inf]
    (axes,) = draw_comparison(LAW, times_s, 60.0).axes
    curves = predicted_curve(LAW, 3), measured_curve(times_s, 60.0)
    for line, band, curve in zip(axes.lines, axes.collections, curves, strict=True):
        np.testing.assert_array_equal(line.get_xdata(), curve.time_s)
        np.testing.assert_array_equal(line.get_ydata(), curve.probability)
        assert line.get_drawstyle() == "steps-post"
        assert set(curve.lower) | set(curve.upper) == set(band.get_paths()[0].vertices[:, 1])
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert "measured in 3 episodes" in labels
    assert axes.get_xlim() == (0.9 * 2.0, 60.0)  # a tenth before the first arrival
    assert png_bytes(axes.figure)


def curve(times, shares):
    share = np.array(shares)
    return ArrivalCurve(np.array(times), share, share, share)


def test_the_measured_curve_counts_who_never_arrived():
    measured = measured_curve([3.0, 5.0, np.inf, 5.0], 60.0)
    assert measured.time_s.tolist() == [0.0, 3.0, 5.0, 60.0]
    assert measured.probability.tolist() == [0.0, 0.25, 0.75, 0.75]
    assert (measured.lower <= measured.probability).all()
    assert (measured.upper >= measured.probability).all()
