"""Curves of learners: one style each, and values where they belong."""

from itertools import combinations

import numpy as np
import pytest

from lab.learner_curves import STYLES, draw_band, draw_intervals, tick_sizes
from serd_app.report.style import new_figure

TOGETHER = (
    ("MDCE SERD", "MDCE IRL", "REIRL"),
    ("MDCE SERD", "MDCE SERD, training part", "MDCE SERD, stopped early"),
    ("PM SERD", "PM SERD, regularised", "MDCE IRL", "REIRL"),
    ("MDCE SERD", "SERD, free belief", "SERD, evidence", "MDCE IRL, likelihood", "REIRL"),
    ("MDCE SERD", "SERD, free belief", "SERD, evidence", "MDCE IRL, entropy", "cloning"),
    ("MDCE SERD", "SERD, averaged", "SERD, evidence", "REIRL", "cloning"),
    ("fixed (IRL)", "tied", "coupled", "free", "true dynamics (IRL)"),
)  # fmt: skip


@pytest.fixture
def axes():
    return new_figure(3.0, 2.0).subplots()


@pytest.mark.parametrize("learners", TOGETHER)
def test_learners_of_one_figure_differ_in_colour_and_marker(learners) -> None:
    for one, other in combinations([STYLES[name] for name in learners], 2):
        assert one.colour != other.colour
        assert one.marker != other.marker


def test_a_band_has_the_median_as_its_line(axes) -> None:
    curve = {"lower": [0.0, 1.0], "median": [1.0, 2.0], "upper": [3.0, 4.0]}
    draw_band(axes, [1, 3], curve, "REIRL")
    (line,) = axes.get_lines()
    assert list(line.get_ydata()) == [1.0, 2.0]
    assert (line.get_label(), line.get_color()) == ("REIRL", STYLES["REIRL"].colour)


def test_intervals_are_shifted_sideways_and_keep_their_ends(axes) -> None:
    values = np.array([[0.0, 1.0], [1.0, 2.0], [3.0, 4.0]])
    draw_intervals(axes, np.array([2, 4]), values, "cloning", 1.0)
    line, _, (bars,) = axes.containers[0]
    assert line.get_xdata() == pytest.approx([2 * 1.04, 4 * 1.04])
    ends = [segment[:, 1].tolist() for segment in bars.get_segments()]
    assert ends == [[0.0, 3.0], [1.0, 4.0]]


def test_an_interval_of_one_size_has_its_ends(axes) -> None:
    draw_intervals(axes, np.array([2]), np.array([[0.0], [1.0], [3.0]]), "cloning", 0.0)
    (bar,) = axes.containers[0][2][0].get_segments()
    assert bar[:, 1].tolist() == [0.0, 3.0]


def test_ticks_are_the_sizes_alone(axes) -> None:
    axes.set_xscale("log")
    tick_sizes(axes, [1, 3, 12])
    assert [label.get_text() for label in axes.get_xticklabels()] == ["1", "3", "12"]
    assert not len(axes.get_xticks(minor=True))
