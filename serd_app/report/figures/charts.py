"""The chart of the outcome models, and error bars."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from serd_app.learning.knowledge import MASS, Knowledge, OutcomeRow
from serd_app.report import style
from serd_app.report.inputs import in_words
from serd_app.report.style import Look, new_figure
from serd_bag.quantities import counted
from serd_core.arrays import FloatArray, IntArray
from serd_core.bayes.information import PRIOR_ONLY
from serd_core.grid.grid import Outcome

OUTCOME_LABELS = tuple(outcome.name.lower() for outcome in Outcome)
_BAR_WIDTH = 0.38
#: Of the legend below the panels of outcomes.
_LEGEND_WIDTH_IN = 6.0


def draw_outcomes(
    model_names: tuple[str, ...],
    initial: FloatArray,
    learned: FloatArray,
    decisions_per_model: IntArray,
    knowledge: Knowledge | None = None,
) -> Figure:
    """One panel per model: probability of each outcome, initial (M, K) and learned (M, K).

    knowledge: the posterior, whose intervals and sources are drawn; None for none.
    """
    with style.report_style():
        figure = new_figure(max(2.35 * len(model_names), _LEGEND_WIDTH_IN), 2.9)
        panels = figure.subplots(1, len(model_names), sharey=True, squeeze=False)[0]
        for i, axes in enumerate(panels):
            rows = () if knowledge is None else knowledge.by_model[model_names[i]]
            tops = [row.upper for row in rows] or learned[i]
            only_prior = bool(rows) and rows[0].known_from == PRIOR_ONLY
            _draw_model(axes, initial[i], learned[i], tops, only_prior=only_prior)
            decided = counted(int(decisions_per_model[i]), "decision")
            if rows:
                _draw_intervals(axes, rows)
                decided += f"\nknown from: {rows[0].known_from}"
            pad = 28 if rows else 16
            axes.set_title(in_words(model_names[i]), loc="left", pad=pad, parse_math=False)
            axes.text(0, 1.02, decided, transform=axes.transAxes, fontsize=8, color=style.MUTED)
        panels[0].set_ylabel("probability")
        shown = panels[0].get_legend_handles_labels()
        figure.legend(*shown, loc="outside lower center", ncols=3)
    return figure


def _draw_intervals(axes: Axes, rows: Sequence[OutcomeRow]) -> None:
    """Median and interval of each outcome over its bar."""
    draw_bars(
        axes,
        np.arange(len(rows)) + _BAR_WIDTH / 2,
        np.array([(row.lower, row.median, row.upper) for row in rows]).T,
        fmt="_",
        color=style.INK,
        markersize=7,
        elinewidth=1.0,
        capsize=2.5,
        label=f"posterior: median, {MASS:.0%} interval".replace("%", " %"),
    )


def _draw_model(
    axes: Axes,
    initial: FloatArray,
    learned: FloatArray,
    tops: Sequence[float] | FloatArray,
    *,
    only_prior: bool,
) -> None:
    """tops: (K,) what the numbers stand above, the bars at least."""
    places = np.arange(len(OUTCOME_LABELS))
    axes.bar(
        places - _BAR_WIDTH / 2,
        initial,
        _BAR_WIDTH,
        color=style.INITIAL_COLOUR,
        hatch="////",
        edgecolor="white",
        linewidth=0,
        label="initial (M-estimate)",
    )
    axes.bar(
        places + _BAR_WIDTH / 2,
        learned,
        _BAR_WIDTH,
        color=style.LEARNED_COLOUR,
        alpha=0.3 if only_prior else 1.0,
        label="learned (SERD)",
    )
    above: Look = {"xytext": (0, 1.5), "textcoords": "offset points", "ha": "center"}
    for place, probability, top in zip(places, learned, tops, strict=True):
        at = (place + _BAR_WIDTH / 2, max(probability, top))
        axes.annotate(f"{probability:.2f}".lstrip("0"), at, fontsize=7, **above)
    axes.set_xticks(places, OUTCOME_LABELS, fontsize=8)
    axes.set_ylim(0, 1.08)
    axes.set_yticks([0, 0.25, 0.5, 0.75, 1.0])
    axes.grid(axis="y")
    axes.tick_params(length=0)
    axes.spines["left"].set_visible(False)


def draw_bars(axes: Axes, at: ArrayLike, values: ArrayLike, **look: Any) -> None:
    """Error bars of (3, n) lower ends, values and upper ends; look: as `Axes.errorbar` has it."""
    ends = np.asarray(values, dtype=np.float64)
    with np.errstate(invalid="ignore"):  # of infinite values, which are not drawn
        lengths = np.diff(ends, axis=0)
    axes.errorbar(at, ends[1], yerr=lengths, **look)
