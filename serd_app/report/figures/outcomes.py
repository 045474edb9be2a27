"""The outcome models: counted beside learned, with what the posterior leaves open."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from serd_app.learning.knowledge import MASS, Knowledge, OutcomeRow
from serd_app.report import style
from serd_app.report.inputs import in_words
from serd_app.report.style import Look, draw_bars, new_figure
from serd_bag.quantities import counted
from serd_core.arrays import FloatArray, IntArray
from serd_core.bayes.information import PRIOR_ONLY
from serd_core.grid.grid import Outcome

OUTCOME_LABELS = tuple(outcome.name.lower() for outcome in Outcome)
_BAR_WIDTH = 0.38
_PLACES = np.arange(len(OUTCOME_LABELS))
#: Of the legend below the panels.
_LEGEND_WIDTH_IN = 6.0


def draw_outcomes(
    model_names: Sequence[str],
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
            decided = counted(int(decisions_per_model[i]), "decision")
            if rows:
                decided += f"\nknown from: {rows[0].known_from}"
            _draw_model(axes, initial[i], learned[i], rows)
            pad = 28 if rows else 16
            axes.set_title(in_words(model_names[i]), loc="left", pad=pad, parse_math=False)
            axes.text(0, 1.02, decided, transform=axes.transAxes, fontsize=8, color=style.MUTED)
        panels[0].set_ylabel("probability")
        shown = panels[0].get_legend_handles_labels()
        figure.legend(*shown, loc="outside lower center", ncols=3)
    return figure


def _draw_model(
    axes: Axes, initial: FloatArray, learned: FloatArray, rows: Sequence[OutcomeRow]
) -> None:
    """The bars, over those learned the interval, and their number above both."""
    counts: Look = {"color": style.INITIAL_COLOUR, "hatch": "////", "edgecolor": "white"}
    counts |= {"linewidth": 0, "label": "initial (M-estimate)"}
    axes.bar(_PLACES - _BAR_WIDTH / 2, initial, _BAR_WIDTH, **counts)
    strength = 0.3 if rows and rows[0].known_from == PRIOR_ONLY else 1.0
    look: Look = {"color": style.BLUE, "alpha": strength, "label": "learned (SERD)"}
    axes.bar(_PLACES + _BAR_WIDTH / 2, learned, _BAR_WIDTH, **look)
    tops = learned
    if rows:
        ends = np.array([(row.lower, row.median, row.upper) for row in rows]).T
        whiskers: Look = {"fmt": "_", "markersize": 7, "elinewidth": 1.0, "capsize": 2.5}
        whiskers |= {"label": f"posterior: median, {100 * MASS:.0f} % interval"}
        draw_bars(axes, _PLACES + _BAR_WIDTH / 2, ends, color=style.INK, **whiskers)
        tops = np.maximum(learned, ends[-1])
    above: Look = {"xytext": (0, 1.5), "textcoords": "offset points", "ha": "center"}
    for place, probability, top in zip(_PLACES, learned, tops, strict=True):
        at = (place + _BAR_WIDTH / 2, top)
        axes.annotate(f"{probability:.2f}".lstrip("0"), at, fontsize=7, **above)
    axes.set_xticks(_PLACES, OUTCOME_LABELS, fontsize=8)
    axes.set_ylim(0, 1.08)
    axes.set_yticks([0, 0.25, 0.5, 0.75, 1.0])
    axes.grid(axis="y")
    axes.tick_params(length=0)
    axes.spines["left"].set_visible(False)
