"""The figure of the people study: likelihood of moves, scores and coverage of arrival times."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lab.experiments.study.people.fold import CONSTANT_VELOCITY
from lab.experiments.study.people.learners import LEARNERS
from serd_app.report import style
from serd_app.report.style import new_figure

METHODS = (*LEARNERS, CONSTANT_VELOCITY)


def people_figure(tables: Mapping[str, pd.DataFrame]) -> Figure:
    """Three panels, a line per method in each."""
    moves, arrivals = tables["moves"], tables["arrivals"]
    scores = arrivals.groupby(["fold", "method"])["crps_s"].mean().reset_index()
    with style.report_style():
        figure = new_figure(12.0, 3.6)
        likelihood, score, coverage = figure.subplots(1, 3, sharey=True)
        _draw_folds(likelihood, moves, "log_likelihood")
        likelihood.set(xlabel="log-likelihood per decision held out")
        likelihood.set_title("(a) next cell", loc="left")
        _draw_folds(score, scores, "crps_s")
        score.set(xlabel="CRPS of the time of arrival [s]")
        score.set_title("(b) time of arrival", loc="left")
        _draw_coverage(coverage, tables["summary"].set_index("method"))
        likelihood.set_yticks(np.arange(len(METHODS)), METHODS)
        likelihood.invert_yaxis()
    return figure


def _draw_folds(axes: Axes, rows: pd.DataFrame, measure: str) -> None:
    """A mark per fold and one for their mean."""
    for place, name in enumerate(METHODS):
        values = rows.loc[rows["method"] == name, measure].astype(float)
        axes.plot(values, np.full(len(values), place), ".", color=style.BLUE, alpha=0.5)
        axes.plot(values.mean(), place, "D", color=style.BLUE, markersize=7)
    axes.grid(axis="x")


def _draw_coverage(axes: Axes, summary: pd.DataFrame) -> None:
    """Measured coverage, beside the nominal one as a line."""
    for share, mark, colour in ((50, "s", style.RED), (90, "D", style.BLUE)):
        held = 100 * summary.loc[list(METHODS), f"coverage_{share}"]
        axes.plot(held, np.arange(len(METHODS)), mark, color=colour, label=f"{share} % interval")
        axes.axvline(share, color=colour, linestyle=":", linewidth=1.0)
    axes.set(xlabel="arrivals within the interval [%]", xlim=(0, 102))
    axes.set_title("(c) coverage", loc="left")
    axes.legend()
    axes.grid(axis="x")
