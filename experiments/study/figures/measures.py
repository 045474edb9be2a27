"""Fig. 5.9: medians with quartiles over the number of demonstrations, for every method."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.figures.ticks import tick_sizes
from experiments.running.repetitions import Row
from experiments.running.summary import quartiles
from experiments.study.figures.context import FigureContext
from experiments.study.figures.looks import METHOD_LOOKS
from experiments.study.recordings.experts import PEOPLE
from experiments.study.tables.results import Results
from report import style
from report.style import new_figure

PANELS = {
    "test_log_likelihood": ("(a) test", "log-likelihood per decision"),
    "transfer_log_likelihood": ("(b) transfer", "log-likelihood per decision"),
    "dynamics_divergence": ("(c) dynamics", "divergence from the reference"),
}

_SERD = "MDCE SERD"
#: All others report the M-estimate; one of them is drawn for all.
_OWN_DYNAMICS = (_SERD, "MDCE IRL, likelihood")


def rows(results: Results) -> list[Row]:
    """Median and quartiles over repetitions for every measure, size and method."""
    chosen = [row for row in results.measures if row["expert"] == PEOPLE]
    return [
        {"measure": measure} | row
        for measure in PANELS
        for row in quartiles(chosen, measure, ["size", "method"])
    ]


def draw(table: list[Row], context: FigureContext) -> Figure:
    """Three panels; points stand side by side so that their quartiles do not cover each other."""
    del context
    with style.report_style():
        figure = new_figure(11.5, 4.5)
        for axes, (measure, (title, label)) in zip(
            figure.subplots(1, 3), PANELS.items(), strict=True
        ):
            panel = [row for row in table if row["measure"] == measure]
            for place, method in enumerate(METHOD_LOOKS):
                lines = [row for row in panel if row["method"] == method]
                if measure != "dynamics_divergence" or method in _OWN_DYNAMICS:
                    _curve(axes, lines, method, place)
            axes.set_title(title, loc="left")
            axes.set(xlabel="demonstrations", ylabel=label, xscale="log")
            if measure == "dynamics_divergence":
                axes.set_yscale("log")
                axes.legend([_SERD, "M-estimate: all others"], loc="upper right")
            else:
                axes.set_ylim(*_shown(panel))
                _name_hidden(axes, panel)
            axes.grid(axis="y")
            tick_sizes(axes, sorted({int(row["size"]) for row in panel}))
        figure.legend(
            *figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=6
        )
    return figure


def _curve(axes: Axes, lines: list[Row], method: str, place: int) -> None:
    look = METHOD_LOOKS[method]
    sizes = [int(row["size"]) * 1.035 ** (place - 2.5) for row in lines]
    low, middle, high = (
        np.array([float(row[name]) for row in lines]) for name in ("lower", "median", "upper")
    )
    axes.errorbar(
        sizes,
        middle,
        yerr=[middle - low, high - middle],
        color=look.colour,
        marker=look.marker,
        linestyle=look.line,
        markersize=5,
        linewidth=1.4,
        elinewidth=1.0,
        label=method,
    )


def _shown(panel: list[Row]) -> tuple[float, float]:
    """Limits that show the better half of all medians; the worst learners start below."""
    low = float(np.quantile([float(row["median"]) for row in panel], 0.4))
    high = max(float(row["upper"]) for row in panel)
    margin = 0.1 * (high - low)
    return low - margin, high + margin


def _name_hidden(axes: Axes, panel: list[Row]) -> None:
    """Say which methods never come into view, with their best median."""
    best: dict[str, float] = {}
    for row in panel:
        method = str(row["method"])
        best[method] = max(best.get(method, -np.inf), float(row["median"]))
    lowest = axes.get_ylim()[0]
    hidden = [f"{method} (at best {value:.2f})" for method, value in best.items() if value < lowest]
    if hidden:
        text = "below: " + ", ".join(hidden).replace("-", "−")
        box = {"facecolor": style.PAPER, "edgecolor": "none", "pad": 1.5}
        axes.text(
            0.98, 0.02, text, transform=axes.transAxes, ha="right", fontsize=7.5, bbox=box, zorder=6
        )
