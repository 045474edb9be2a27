"""Figures 4.12 and 4.13: the four measures over the demonstrations."""

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lab.experiments.running.tables import quartiles
from lab.learner_curves import draw_band, tick_sizes
from serd_app.report.style import HAIRLINE, MUTED, new_figure

MEASURES = {
    "log_likelihood": "log-likelihood per decision",
    "dynamics_divergence": "KLD of the dynamics",
    "policy_divergence": "KLD of the policy",
    "transfer_log_likelihood": "log-likelihood in the transfer scene",
}
#: Log-likelihoods below this, minus infinity (a choice ruled out) among them, are drawn here.
LOWEST = -4.0
#: Divergences above this, infinity (the truth ruled out) among them, are drawn here.
HIGHEST = 100.0


def measures_figure(table: pd.DataFrame) -> Figure:
    """Figs. 4.12 and 4.13: median with quartiles by learner, of the measures there are."""
    present = {name: label for name, label in MEASURES.items() if name in table}
    figure = new_figure(9.0, 6.8)
    panels = figure.subplots(2, 2).ravel()
    for letter, axes, (measure, label) in zip("abcd", panels, present.items(), strict=False):
        for learner, chosen in table.groupby("learner", sort=False):
            curve = quartiles(chosen, measure, ["size"])
            shown = curve[["lower", "median", "upper"]].clip(LOWEST, HIGHEST)
            draw_band(axes, curve["size"], shown, learner)
        axes.set(xlabel="demonstrations", ylabel=label, xscale="log")
        axes.set_title(f"({letter})", loc="left")
        axes.grid(color=HAIRLINE, linewidth=0.6)
        if "divergence" in measure:
            axes.set_yscale("log")
            if max(axes.get_ylim()) > HIGHEST:
                _mark_limit(axes, HIGHEST, f"{HIGHEST:.0f} or above", offset_points=-11)
        elif min(axes.get_ylim()) < LOWEST + 0.5:
            _mark_limit(axes, LOWEST, f"{LOWEST:.0f} or below", offset_points=3)
        tick_sizes(axes, sorted(table["size"].unique()))
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), frameon=False)
    for unused in panels[len(present) :]:
        unused.set_axis_off()
    return figure


def _mark_limit(axes: Axes, value: float, text: str, *, offset_points: float) -> None:
    """A line at which values beyond it are drawn."""
    axes.axhline(value, color=MUTED, linewidth=0.8, linestyle=":")
    axes.annotate(text, (0.98, value), xycoords=("axes fraction", "data"),
                  xytext=(0, offset_points), textcoords="offset points", ha="right", color=MUTED,
                  fontsize="small")  # fmt: skip
