"""Fig. 5.9: medians with quartiles over the number of demonstrations, for every method."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.running.tables import quartiles
from experiments.study.recordings.experts import PEOPLE
from experiments.study.study import Study
from experiments.study.tables.results import Results
from report import style
from report.learners import draw_intervals, tick_sizes
from report.style import new_figure

PANELS = {
    "test_log_likelihood": ("(a) test", "log-likelihood per decision"),
    "transfer_log_likelihood": ("(b) transfer", "log-likelihood per decision"),
    "dynamics_divergence": ("(c) dynamics", "divergence from the reference"),
}

_SERD = "MDCE SERD"
#: All others report the M-estimate; one of them is drawn for all.
_OWN_DYNAMICS = (_SERD, "MDCE IRL, likelihood")


def rows(results: Results) -> pd.DataFrame:
    """Median and quartiles over repetitions for every measure, size and method."""
    chosen = results.measures[results.measures["expert"] == PEOPLE]
    tables = {name: quartiles(chosen, name, ["size", "method"]) for name in PANELS}
    return pd.concat(tables, names=["measure", None]).reset_index("measure")


def draw(table: pd.DataFrame, study: Study) -> Figure:
    """Three panels; points are drawn side by side so that their quartiles do not overlap."""
    del study
    methods = table["method"].unique()
    with style.report_style():
        figure = new_figure(11.5, 4.5)
        for axes, (measure, (title, label)) in zip(
            figure.subplots(1, 3), PANELS.items(), strict=True
        ):
            panel = table[table["measure"] == measure]
            for place, method in enumerate(methods):
                if measure != "dynamics_divergence" or method in _OWN_DYNAMICS:
                    curve = panel[panel["method"] == method]
                    values = curve[["lower", "median", "upper"]].to_numpy().T
                    draw_intervals(axes, curve["size"], values, method, place - 2.5)
            axes.set_title(title, loc="left")
            axes.set(xlabel="demonstrations", ylabel=label, xscale="log")
            if measure == "dynamics_divergence":
                axes.set_yscale("log")
                axes.legend([_SERD, "M-estimate: all others"], loc="upper right")
            else:
                axes.set_ylim(*_shown(panel))
                _name_hidden(axes, panel)
            axes.grid(axis="y")
            tick_sizes(axes, sorted(panel["size"].unique()))
        figure.legend(
            *figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=6
        )
    return figure


def _shown(panel: pd.DataFrame) -> tuple[float, float]:
    """Limits that show the better half of all medians; the worst learners start below."""
    low, high = float(np.quantile(panel["median"], 0.4)), float(panel["upper"].max())
    margin = 0.1 * (high - low)
    return low - margin, high + margin


def _name_hidden(axes: Axes, panel: pd.DataFrame) -> None:
    """Name the methods that are below the axis everywhere, with their best median."""
    best = panel.groupby("method", sort=False)["median"].max()
    hidden = best[best < axes.get_ylim()[0]]
    if len(hidden):
        names = ", ".join(f"{method} (at best {value:.2f})" for method, value in hidden.items())
        box = {"facecolor": style.PAPER, "edgecolor": "none", "pad": 1.5}
        axes.text(
            0.98,
            0.02,
            f"below: {names}".replace("-", "−"),
            transform=axes.transAxes,
            ha="right",
            fontsize=7.5,
            bbox=box,
            zorder=6,
        )
