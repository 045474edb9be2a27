"""Figures 4.10 to 4.13: the environments, and the four measures over the demonstrations."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from experiments.figures.ticks import tick_sizes
from experiments.gridworld import Scene
from experiments.repetitions import Row
from experiments.summary import quartiles
from report.canvas import new_figure
from report.style import BLUE, GREEN, PURPLE, RED
from serd_core.arrays import FloatArray
from serd_core.demonstrations import state_counts

MEASURES = {
    "log_likelihood": "log-likelihood per decision",
    "dynamics_divergence": "KLD of the dynamics",
    "policy_divergence": "KLD of the policy",
    "transfer_log_likelihood": "transfer log-likelihood",
}
#: Medians of minus infinity (a choice ruled out) are drawn at the lower edge.
LOWEST = -6.0


def measures_figure(rows: Sequence[Row]) -> Figure:
    """Figs. 4.12 and 4.13: median with quartiles by learner, of the measures there are."""
    present = {name: label for name, label in MEASURES.items() if name in rows[0]}
    figure = new_figure(9.0, 6.4)
    learners = list(dict.fromkeys(row["learner"] for row in rows))
    colours = dict(zip(learners, (BLUE, PURPLE, RED, GREEN), strict=False))
    for axes, (measure, label) in zip(figure.subplots(2, 2).ravel(), present.items(), strict=False):
        for row_learner in learners:
            chosen = [row for row in rows if row["learner"] == row_learner]
            table = quartiles(chosen, measure, ["size"])
            sizes = [row["size"] for row in table]
            low, middle, high = (
                np.maximum([row[name] for row in table], LOWEST)
                for name in ("lower", "median", "upper")
            )
            colour = colours[row_learner]
            axes.plot(sizes, middle, "o-", color=colour, label=row_learner)
            axes.fill_between(sizes, low, high, color=colour, alpha=0.2, linewidth=0)
        axes.set(xlabel="demonstrations", ylabel=label, xscale="log")
        if "divergence" in measure:
            axes.set_yscale("log")
        tick_sizes(axes, sorted({row["size"] for row in rows}))
    figure.axes[0].legend()
    for unused in figure.axes[len(present) :]:
        unused.set_axis_off()
    return figure


def environment_figure(scene: Scene, weights: FloatArray, value: FloatArray) -> Figure:
    """Figs. 4.10 and 4.11: brightness, terrain, reward, value and visits of new demonstrations."""
    problem = scene.world.problem
    side = int(np.sqrt(problem.mdp.n_states))
    panels = {
        "brightness": problem.features[:, 0, 0],
        "forest": scene.world.forest.astype(np.float64),
        "reward": problem.features[:, 0] @ weights,
        "value": value,
        "visits": state_counts(scene.test, problem.mdp.n_states),
    }
    figure = new_figure(2.6 * len(panels), 2.8)
    for axes, (title, values) in zip(figure.subplots(1, len(panels)), panels.items(), strict=True):
        drawn = axes.imshow(values.reshape(side, side), origin="lower")
        axes.set(title=title, xticks=[], yticks=[])
        figure.colorbar(drawn, ax=axes, shrink=0.7)
    return figure
