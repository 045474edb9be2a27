"""Figures of the experiments show every learner and label where they cut."""

import numpy as np
import pandas as pd

from lab.experiments.gridworld.figures import LOWEST, measures_figure
from lab.learner_curves import STYLES


def table(values):
    rows = [
        {"size": size, "learner": learner, "log_likelihood": value, "policy_divergence": 0.1}
        for learner, by_size in values.items()
        for size, value in by_size.items()
    ]
    return pd.DataFrame(rows)


def test_every_learner_has_a_line_and_an_entry_in_the_legend():
    figure = measures_figure(table({"MDCE SERD": {1: -1.0, 3: -0.5}, "REIRL": {1: -2.0, 3: -1.0}}))
    likelihood = figure.axes[0]
    lines = {line.get_label(): line for line in likelihood.get_lines()}
    np.testing.assert_allclose(lines["MDCE SERD"].get_ydata(), [-1.0, -0.5])
    assert lines["REIRL"].get_linestyle() == STYLES["REIRL"].line
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["MDCE SERD", "REIRL"]
    assert not likelihood.texts


def test_what_lies_below_the_axis_is_drawn_at_its_edge_and_labelled():
    figure = measures_figure(table({"MDCE SERD": {1: -np.inf, 3: -0.5}}))
    drawn = figure.axes[0].get_lines()[0].get_ydata()
    assert drawn[0] == LOWEST
    assert [text.get_text() for text in figure.axes[0].texts] == ["-4 or below"]
