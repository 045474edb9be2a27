"""Fig. 5.9: medians with quartiles over the number of demonstrations, for every method."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lab.experiments.running.tables import quartiles
from lab.experiments.study.hallway.tables import Results
from lab.experiments.study.recordings.experts import PEOPLE
from lab.learner_curves import draw_intervals, tick_sizes
from serd_app.report import style
from serd_app.report.style import Look, new_figure

PANELS = {
    "test_log_likelihood": ("(a) test", "log-likelihood per decision"),
    "transfer_log_likelihood": ("(b) transfer", "log-likelihood per decision"),
    "dynamics_divergence": ("(c) dynamics", "divergence from the reference"),
}

#: With dynamics of their own, but for the last: all others report the M-estimate, as it does.
_DYNAMICS = ("MDCE SERD", "SERD, evidence", "MDCE IRL, likelihood")


def rows(results: Results) -> pd.DataFrame:
    """Median and quartiles over repetitions for every measure, size and method."""
    chosen = results.measures[results.measures["expert"] == PEOPLE]
    tables = {name: quartiles(chosen, name, ["size", "method"]) for name in PANELS}
    return pd.concat(tables, names=["measure", None]).reset_index("measure")


def draw(table: pd.DataFrame) -> Figure:
    """Three panels; points are drawn side by side so that their quartiles do not overlap.

    The axis of a log-likelihood is broken: above, the better half of all medians; below, the rest.
    """
    with style.report_style():
        figure = new_figure(11.5, 5.2)
        axes: dict[str, Axes] = figure.subplot_mosaic(
            [["a", "b", "c"], ["a below", "b below", "c"]], height_ratios=[3, 1.2]
        )
        for letter, (measure, (title, label)) in zip("abc", PANELS.items(), strict=True):
            panel, above = table[table["measure"] == measure], axes[letter]
            above.set_title(title, loc="left")
            above.set_ylabel(label)
            if measure == "dynamics_divergence":
                drawn = panel[panel["method"].isin(_DYNAMICS)]
                _curves(above, drawn)
                above.set(xlabel="demonstrations", yscale="log")
                *names, _ = drawn["method"].unique()
                above.legend([*names, "M-estimate: all others"], loc="upper right")
            else:
                below = axes[f"{letter} below"]
                _curves(above, panel)
                _curves(below, panel)
                below.set_xlabel("demonstrations")
                _break(above, below, panel)
        handles = axes["a"].get_legend_handles_labels()
        figure.legend(*handles, loc="outside lower center", ncols=len(handles[0]))
    return figure


def _curves(axes: Axes, panel: pd.DataFrame) -> None:
    curves = list(panel.groupby("method", sort=False))
    for place, (method, curve) in enumerate(curves):
        values = curve[["lower", "median", "upper"]].to_numpy().T
        shift = place - (len(curves) - 1) / 2
        draw_intervals(axes, curve["size"], values, str(method), shift)
    axes.set_xscale("log")
    axes.grid(axis="y")
    tick_sizes(axes, sorted(panel["size"].unique()))


def _break(above: Axes, below: Axes, panel: pd.DataFrame) -> None:
    """Let the axis of `below` end where that of `above` begins, with the usual marks."""
    finite = panel[np.isfinite(panel[["lower", "median", "upper"]]).all(axis=1)]
    if not finite.empty:
        low, high = float(np.quantile(finite["median"], 0.4)), float(finite["upper"].max())
        margin = max(0.1 * (high - low), 1e-3)
        above.set_ylim(low - margin, high + margin)
        bottom = min(float(finite["lower"].min()) - margin, low - 1.5 * margin)
        below.set_ylim(bottom, low - margin)
    above.spines["bottom"].set_visible(False)
    above.tick_params(axis="x", length=0, labelbottom=False)
    mark: Look = {"marker": [(-1, -0.6), (1, 0.6)], "markersize": 9, "linestyle": "none"}
    for axes, edge in ((above, 0), (below, 1)):
        axes.plot([0], [edge], color=style.INK, clip_on=False, transform=axes.transAxes, **mark)
