"""The learned outcome models (Eq. 5.1, Table 5.1) beside the initial M-estimates."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from report import style
from report.canvas import new_figure
from report.wording import counted, in_words
from serd_core.arrays import FloatArray, IntArray, float_array
from serd_core.grid.grid import Outcome

OUTCOME_LABELS = tuple(outcome.name.lower() for outcome in Outcome)
_BAR_WIDTH = 0.38


def draw_outcomes(
    model_names: tuple[str, ...],
    initial: FloatArray,
    learned: FloatArray,
    decisions_per_model: IntArray,
) -> Figure:
    """One panel per model: probability of each outcome, initial (M, K) and learned (M, K)."""
    shape = (len(model_names), len(OUTCOME_LABELS))
    before = float_array("initial outcome probabilities", initial, shape)
    after = float_array("learned outcome probabilities", learned, shape)
    with style.report_style():
        figure = new_figure(2.35 * len(model_names), 2.9)
        panels = figure.subplots(1, len(model_names), sharey=True, squeeze=False)[0]
        for i, axes in enumerate(panels):
            _draw_model(axes, before[i], after[i])
            decided = counted(int(decisions_per_model[i]), "decision")
            axes.set_title(in_words(model_names[i]), loc="left", pad=16, parse_math=False)
            axes.text(0, 1.02, decided, transform=axes.transAxes, fontsize=8, color=style.MUTED)
        panels[0].set_ylabel("probability")
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


def _draw_model(axes: Axes, initial: FloatArray, learned: FloatArray) -> None:
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
    bars = axes.bar(
        places + _BAR_WIDTH / 2,
        learned,
        _BAR_WIDTH,
        color=style.LEARNED_COLOUR,
        label="learned (SERD)",
    )
    axes.bar_label(bars, labels=[f"{p:.2f}".lstrip("0") for p in learned], fontsize=7, padding=1)
    axes.set_xticks(places, OUTCOME_LABELS, fontsize=8)
    axes.set_ylim(0, 1.08)
    axes.set_yticks([0, 0.25, 0.5, 0.75, 1.0])
    axes.grid(axis="y")
    axes.tick_params(length=0)
    axes.spines["left"].set_visible(False)
