"""Figures 4.10 to 4.13: the environments, and the four measures over the demonstrations."""

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, PowerNorm
from matplotlib.figure import Figure

from lab.experiments.gridworld.problem import Gridworld
from lab.experiments.running.tables import quartiles
from lab.learner_curves import draw_band, tick_sizes
from serd_app.report.style import HAIRLINE, MUTED, RED, VISITS_MAP, new_figure
from serd_core.arrays import FloatArray

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
#: Visits are drawn by their cube root, so that paths show beside places where people stay.
VISITS_POWER = 1.0 / 3.0
LAWN_AND_FOREST = ListedColormap(["#e8e4c9", "#5d8a54"])


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


def environment_figure(
    world: Gridworld, weights: FloatArray, value: FloatArray, visits: FloatArray
) -> Figure:
    """Figs. 4.10 and 4.11: brightness, terrain, reward, value and visits; the last two (S,)."""
    problem = world.problem
    side = int(np.sqrt(problem.mdp.n_states))
    panels: dict[str, tuple[FloatArray, dict[str, Any]]] = {
        "brightness": (problem.features[:, 0, 0], {"cmap": "gray"}),
        "forest": (world.forest.astype(np.float64), {"cmap": LAWN_AND_FOREST}),
        "reward": (problem.features[:, 0] @ weights, {"cmap": "viridis"}),
        "value": (value, {"cmap": "viridis"}),
        "visits": (visits, {"cmap": VISITS_MAP, "norm": PowerNorm(VISITS_POWER)}),
    }
    figure = new_figure(2.5 * len(panels), 2.5)
    goal = np.unravel_index(world.goal, (side, side))
    for axes, (title, (values, look)) in zip(
        figure.subplots(1, len(panels)), panels.items(), strict=True
    ):
        drawn = axes.imshow(values.reshape(side, side), origin="lower", **look)
        axes.plot(goal[1], goal[0], "*", color=RED, markeredgecolor="white", markersize=9)
        axes.set(title=title, xticks=[], yticks=[])
        if title == "forest":
            bar = figure.colorbar(drawn, ax=axes, shrink=0.8, ticks=[0.25, 0.75])
            bar.ax.set_yticklabels(["open", "forest"], rotation=90, va="center")
        else:
            bar = figure.colorbar(drawn, ax=axes, shrink=0.8)
            if title == "visits":
                bar.set_ticks(visit_ticks(int(visits.max())))
    return figure


def visit_ticks(most: int) -> list[int]:
    """Numbers of visits that stand apart where a colour bar grows by the cube root."""
    shares = (0.0, 0.02, 0.15, 0.45, 1.0)
    return sorted({round(share * most) for share in shares})


def _mark_limit(axes: Axes, value: float, text: str, *, offset_points: float) -> None:
    """A line at which values beyond it are drawn."""
    axes.axhline(value, color=MUTED, linewidth=0.8, linestyle=":")
    axes.annotate(text, (0.98, value), xycoords=("axes fraction", "data"),
                  xytext=(0, offset_points), textcoords="offset points", ha="right", color=MUTED,
                  fontsize="small")  # fmt: skip
