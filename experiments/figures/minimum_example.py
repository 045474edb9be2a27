"""Figures 4.8 and 4.9: where the estimates lie, and how likely the expert is under them."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.figures.ticks import tick_sizes
from experiments.running.repetitions import Row
from experiments.running.summary import quartiles
from report.style import BLUE, CYAN, HAIRLINE, INK, MUTED, RED, new_figure

COLOURS = {"MDCE SERD": BLUE, "MDCE IRL": RED}
#: Weights beyond this either way are drawn in the outermost bins.
WIDEST = 60.0


def estimates_figure(rows: Sequence[Row]) -> Figure:
    """Fig. 4.8: estimated transition models, and densities of the learned weights."""
    figure = new_figure(8.6, 4.0)
    dynamics, weights = figure.subplots(1, 2)
    for learner, colour in COLOURS.items():
        chosen = [row for row in rows if row["learner"] == learner]
        across = [row["moves_on_a"] for row in chosen]
        upward = [row["moves_on_b"] for row in chosen]
        dynamics.plot(across, upward, ".", color=colour, alpha=0.25, markersize=4, label=learner)
        _density(weights, [row["weight"] for row in chosen], colour, learner)
    dynamics.plot([0, 1], [0, 1], "--", color=MUTED, linewidth=1)
    dynamics.set(xlabel="P(2 | 1, a)", ylabel="P(2 | 1, b)", title="estimated dynamics")
    dynamics.set(xlim=(-0.02, 1.02), ylim=(-0.02, 1.02), aspect="equal")
    for text, height in (("mode A: state 2 is shunned", 0.82), ("mode B: state 2 is sought", 0.1)):
        dynamics.text(0.5, height, text, color=INK, ha="center", fontsize="small")
    dynamics.text(0.5, 0.53, "given to IRL", color=INK, ha="right", fontsize="small")
    weights.set(xlabel=f"reward weight (beyond {WIDEST:.0f}: at the edge)", ylabel="density")
    weights.set(title="estimated reward")
    weights.legend(frameon=False)
    return figure


def likelihood_figure(rows: Sequence[Row]) -> Figure:
    """Fig. 4.9: median and quartiles of the log-likelihood by size, SERD split by mode.

    Drawn is its negative on a logarithmic axis, so lower is better.
    """
    figure = new_figure(6.0, 3.8)
    axes = figure.subplots()
    series = {
        "MDCE SERD, mode A": ("MDCE SERD", "A", CYAN),
        "MDCE SERD, mode B": ("MDCE SERD", "B", BLUE),
        "MDCE IRL": ("MDCE IRL", None, RED),
    }
    for label, (learner, mode, colour) in series.items():
        chosen = [
            row
            for row in rows
            if row["learner"] == learner and (mode is None or row["mode"] == mode)
        ]
        if chosen:
            _quartile_band(axes, quartiles(chosen, "log_likelihood", ["size"]), colour, label)
    axes.set(xlabel="demonstrations", ylabel="minus log-likelihood of the choice", xscale="log")
    axes.set_yscale("log")
    tick_sizes(axes, sorted({row["size"] for row in rows}))
    axes.grid(color=HAIRLINE, linewidth=0.6)
    axes.legend(frameon=False)
    return figure


def _density(axes: Axes, values: Sequence[float], colour: str, label: str) -> None:
    inside = np.clip(values, -WIDEST, WIDEST)
    limits = (-WIDEST, WIDEST)
    axes.hist(inside, bins=60, range=limits, density=True, color=colour, alpha=0.55, label=label)


def _quartile_band(axes: Axes, table: Sequence[Row], colour: str, label: str) -> None:
    ordered = sorted(table, key=lambda row: row["size"])
    sizes = [row["size"] for row in ordered]
    low, middle, high = ([-row[name] for row in ordered] for name in ("lower", "median", "upper"))
    axes.plot(sizes, middle, "o-", color=colour, label=label)
    axes.fill_between(sizes, low, high, color=colour, alpha=0.2, linewidth=0)
    axes.tick_params(colors=INK)
