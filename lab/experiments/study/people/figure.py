"""The figure of the people study: likelihood, scores and calibration of arrival times."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lab.experiments.study.people.learners import CLONING, IRL, SERD
from lab.experiments.study.people.tables import PERIODS
from lab.experiments.study.people.walkers import (
    CONSTANT_VELOCITY,
    DISTANCE_OVER_SPEED,
)
from serd_app.report import style
from serd_app.report.style import new_figure

COLOURS = {
    SERD: style.BLUE,
    IRL: style.RED,
    CLONING: style.YELLOW,
    CONSTANT_VELOCITY: style.GREEN,
    PERIODS: style.WALL,
    DISTANCE_OVER_SPEED: style.INK,
}
_BINS = np.linspace(0.0, 1.0, 11)
#: Methods whose calibration is drawn.
_DRAWN = (SERD, CLONING, CONSTANT_VELOCITY)


def people_figure(tables: Mapping[str, pd.DataFrame]) -> Figure:
    """Four panels."""
    moves, arrivals = tables["moves"], tables["arrivals"]
    with style.report_style():
        figure = new_figure(11.0, 7.2)
        panels = figure.subplots(2, 2)
        _draw_folds(panels[0, 0], moves.set_index("fold"), "log_likelihood")
        panels[0, 0].set(xlabel="log-likelihood per move held out")
        panels[0, 0].set_title("(a) next cell", loc="left")
        scores = arrivals.groupby(["fold", "method"])["crps_s"].mean().reset_index()
        _draw_folds(panels[0, 1], scores.set_index("fold"), "crps_s")
        panels[0, 1].set(xlabel="CRPS of the time of arrival [s]", xlim=(0, None))
        panels[0, 1].set_title("(b) time of arrival", loc="left")
        _draw_transforms(panels[1, 0], arrivals)
        _draw_intervals(panels[1, 1], tables["summary"])
    return figure


def _draw_folds(axes: Axes, rows: pd.DataFrame, measure: str) -> None:
    """A mark per fold and the mean, a line per method."""
    names = [name for name in COLOURS if name in set(rows["method"])]
    for place, name in enumerate(reversed(names)):
        values = rows.loc[rows["method"] == name, measure].astype(float)
        axes.plot(values, np.full(len(values), place), ".", color=COLOURS[name], alpha=0.5)
        axes.plot(values.mean(), place, "D", color=COLOURS[name], markersize=7)
    axes.set_yticks(np.arange(len(names)), list(reversed(names)))
    axes.grid(axis="x")


def _draw_transforms(axes: Axes, arrivals: pd.DataFrame) -> None:
    """Share of arrivals in each tenth of the forecast; uniform where it is calibrated."""
    for name in _DRAWN:
        values = arrivals.loc[arrivals["method"] == name, "pit"].to_numpy()
        share = np.histogram(values, _BINS)[0] / max(len(values), 1)
        axes.stairs(10 * share, _BINS, color=COLOURS[name], label=name, linewidth=1.6)
    axes.axhline(1.0, color=style.INK, linestyle=":", linewidth=1.0)
    axes.set(xlabel="F(measured time of arrival)", ylabel="density", xlim=(0, 1), ylim=(0, None))
    axes.set_title("(c) probability integral transform", loc="left")
    axes.legend()


def _draw_intervals(axes: Axes, summary: pd.DataFrame) -> None:
    """Measured against nominal coverage."""
    rows = summary[summary["coverage_90"].notna()]
    for place, row in enumerate(reversed(rows.to_dict("records"))):
        colour = COLOURS[row["method"]]
        axes.plot(100 * row["coverage_50"], place, "s", color=colour, markersize=7)
        axes.plot(100 * row["coverage_90"], place, "D", color=colour, markersize=7)
    for share in (50, 90):
        axes.axvline(share, color=style.INK, linestyle=":", linewidth=1.0)
    axes.axvspan(85, 95, color=style.GREEN, alpha=0.12, linewidth=0)
    axes.set_yticks(np.arange(len(rows)), list(reversed(list(rows["method"]))))
    axes.set(
        xlabel="arrivals within the 50 % (square) and 90 % interval (diamond) [%]", xlim=(0, 100)
    )
    axes.set_title("(d) coverage", loc="left")
    axes.grid(axis="x")
