"""Charts carry the steps of their curves and the numbers that they were given."""

import matplotlib as mpl
import numpy as np
from matplotlib.container import BarContainer, ErrorbarContainer

from serd_app.learning.knowledge import DynamicsRow
from serd_app.report.charts import (
    OUTCOME_LABELS,
    draw_comparison,
    draw_outcomes,
    measured_curve,
)
from serd_app.report.style import png_bytes
from serd_core.arrival.law import ArrivalLaw, sampling_band
from serd_core.bayes.information import PRIOR_ONLY
from serd_core.grid.navigation import MODEL_NAMES

LAW = ArrivalLaw(2.0 * np.arange(4), np.array([0.0, 0.2, 0.6, 0.9]), 1.0)


def test_the_arrival_figure_draws_both_curves_with_their_bands():
    times_s = [3.0, 5.0, np.inf]
    (axes,) = draw_comparison(LAW, times_s, 60.0).axes
    curves = [
        (LAW.times_s, LAW.cdf, *sampling_band(LAW.cdf, 3)),
        [getattr(measured_curve(times_s, 60.0), n) for n in ("times_s", "cdf", "lower", "upper")],
    ]
    for line, band, curve in zip(axes.lines, axes.collections, curves, strict=True):
        at, cdf, lower, upper = curve
        np.testing.assert_array_equal(line.get_xdata(), at)
        np.testing.assert_array_equal(line.get_ydata(), cdf)
        assert line.get_drawstyle() == "steps-post"
        assert set(lower) | set(upper) == set(band.get_paths()[0].vertices[:, 1])
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert "measured in 3 episodes" in labels
    assert axes.get_xlim() == (0.9 * 2.0, 60.0)  # a tenth before the first arrival
    assert png_bytes(axes.figure)


def test_the_measured_curve_counts_who_never_arrived():
    measured = measured_curve([3.0, 5.0, np.inf, 5.0], 60.0)
    assert measured.times_s.tolist() == [0.0, 3.0, 5.0, 60.0]
    assert measured.cdf.tolist() == [0.0, 0.25, 0.75, 0.75]
    assert (measured.lower <= measured.cdf).all()
    assert (measured.upper >= measured.cdf).all()


def bars(figure, panel=0):
    return [c for c in figure.axes[panel].containers if isinstance(c, BarContainer)]


def rows_of(counted, joint, ends=(np.nan, np.nan)):
    return [
        DynamicsRow(model, outcome, np.nan, counted[m][k], np.nan, ends[0], joint[m][k], ends[1])
        for m, model in enumerate(MODEL_NAMES)
        for k, outcome in enumerate(OUTCOME_LABELS)
    ]


def test_bars_have_the_lengths_of_the_probabilities():
    before = dict(mpl.rcParams)
    counted, joint = np.random.default_rng(0).dirichlet(np.ones(5), size=(2, 4))
    decisions = dict(zip(MODEL_NAMES, (455, 0, 1, 13), strict=True))
    figure = draw_outcomes(rows_of(counted, joint), decisions, {})
    counts = ["455 decisions", "0 decisions", "1 decision", "13 decisions"]
    for i, axes in enumerate(figure.axes):
        for drawn, table in zip(bars(figure, i), (counted, joint), strict=True):
            np.testing.assert_allclose([bar.get_height() for bar in drawn], table[i])
        assert not [each for each in axes.containers if isinstance(each, ErrorbarContainer)]
        assert axes.get_title(loc="left") == MODEL_NAMES[i].replace("_", " ")
        assert counts[i] in [text.get_text() for text in axes.texts]
    assert png_bytes(figure)
    assert dict(mpl.rcParams) == before  # drawing leaves the global settings alone


def test_the_posterior_is_drawn_with_its_sources_and_the_prior_alone_pale():
    table = np.full((4, 5), 0.2) + 0.01 * np.arange(4)[:, None]
    sources = ("counts", PRIOR_ONLY, "choices", "counts and choices")
    known = dict(zip(MODEL_NAMES, sources, strict=True))
    figure = draw_outcomes(rows_of(table, table, (0.1, 0.6)), dict.fromkeys(MODEL_NAMES, 1), known)
    for i, axes in enumerate(figure.axes):
        (limits,) = (each for each in axes.containers if isinstance(each, ErrorbarContainer))
        np.testing.assert_allclose(limits[0].get_ydata(), 0.2 + 0.01 * i)
        np.testing.assert_allclose(
            [ends[:, 1] for ends in limits[2][0].get_segments()], [[0.1, 0.6]] * 5
        )
        assert bars(figure, i)[1][0].get_alpha() == (0.3 if i == 1 else 1.0)
        texts = "".join(text.get_text() for text in axes.texts)
        assert f"known from: {sources[i]}" in texts
    assert png_bytes(figure)
