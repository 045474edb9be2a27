"""Fig. 5.8: lambda of the divergence prior against the number of demonstrations."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from lab.experiments.running.tables import quantile
from lab.experiments.study.hallway.tables.results import Results
from lab.experiments.study.study import Study
from serd_app.report import style
from serd_app.report.style import new_figure
from serd_core.arrays import FloatArray

PANELS = {
    "validation_log_likelihood": "(a) validation log-likelihood",
    "test_log_likelihood": "(b) test log-likelihood",
    "transfer_log_likelihood": "(c) transfer log-likelihood",
    "dynamics_divergence": "(d) divergence of the dynamics",
}


def rows(results: Results) -> pd.DataFrame:
    """Medians over repetitions for every size and lambda: one may rule out an action altogether."""
    groups = results.candidates.groupby(["size", "prior_weight"])
    medians = groups[list(PANELS)].agg(lambda values: quantile(values, 0.5))
    medians.insert(0, "n", groups.size())
    return medians.reset_index()


def draw(table: pd.DataFrame, study: Study) -> Figure:
    """Four heat maps with their numbers; the best lambda of each size is framed."""
    del study
    with style.report_style():
        figure = new_figure(11.0, 6.6)
        for axes, (name, title) in zip(figure.subplots(2, 2).ravel(), PANELS.items(), strict=True):
            values = table.pivot(index="prior_weight", columns="size", values=name)
            sizes, weights = values.columns, values.index
            _panel(figure, axes, values.to_numpy(), higher_is_better=name != "dynamics_divergence")
            axes.set_title(title, loc="left")
            axes.set_xticks(range(len(sizes)), [str(size) for size in sizes])
            axes.set_yticks(range(len(weights)), [f"{weight:g}" for weight in weights])
            axes.set_xlabel("demonstrations")
            axes.set_ylabel("prior weight λ")
    return figure


def _panel(figure: Figure, axes: Axes, values: FloatArray, *, higher_is_better: bool) -> None:
    colours = style.VALUE_MAP if higher_is_better else style.VALUE_MAP.reversed()
    # Few demonstrations are far worse: off the scale, they leave room for what matters.
    finite = values[np.isfinite(values)]
    low, high = np.quantile(finite, [0.25, 1.0] if higher_is_better else [0.0, 0.75])
    shown = np.clip(values, low, high)
    drawn = axes.imshow(shown, origin="lower", aspect="auto", cmap=colours, vmin=low, vmax=high)
    figure.colorbar(drawn, ax=axes, shrink=0.9, extend="min" if higher_is_better else "max")
    best = values.argmax(axis=0) if higher_is_better else values.argmin(axis=0)
    for (row, column), value in np.ndenumerate(values):
        weight = "bold" if row == best[column] else "normal"
        text = f"{value:.3f}".replace("-", "−").replace("inf", "∞")
        axes.text(column, row, text, ha="center", va="center", fontsize=7.5, fontweight=weight)
    for column, row in enumerate(best):
        _frame(axes, column, int(row))
    axes.tick_params(length=0)
    for spine in axes.spines.values():
        spine.set_visible(False)


def _frame(axes: Axes, column: int, row: int) -> None:
    place = (column - 0.47, row - 0.45)
    axes.add_patch(Rectangle(place, 0.94, 0.9, fill=False, edgecolor=style.RED, linewidth=1.4))
