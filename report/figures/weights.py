"""The learned reward weights as named bars."""

import numpy as np
from matplotlib.figure import Figure

from report import style
from report.canvas import new_figure
from report.errors import ReportError
from report.wording import in_words
from serd_core.arrays import FloatArray, float_array


def draw_weights(feature_names: tuple[str, ...], reward_weights: FloatArray) -> Figure:
    """One horizontal bar per feature, its value written at its end; first feature on top."""
    weights = float_array("reward_weights", reward_weights, (None,))
    if len(weights) != len(feature_names):
        raise ReportError(
            f"reward_weights must have one value per feature ({len(feature_names)}), "
            f"got {len(weights)}; pass the names the weights were learned with"
        )
    with style.report_style():
        figure = new_figure(5.6, 0.7 + 0.5 * len(weights))
        axes = figure.subplots()
        rows = np.arange(len(weights))
        colours = [style.BLUE if w >= 0 else style.RED for w in weights]
        bars = axes.barh(rows, weights, height=0.6, color=colours)
        axes.bar_label(
            bars,
            labels=[f"{w:+.2f}".replace("-", "\N{MINUS SIGN}") for w in weights],
            padding=4,
            fontsize=8.5,
        )
        axes.set_yticks(rows, [in_words(name) for name in feature_names], parse_math=False)
        axes.invert_yaxis()
        axes.axvline(0, color=style.MUTED, linewidth=0.8)
        axes.margins(x=0.18)
        axes.spines["left"].set_visible(False)
        axes.tick_params(axis="y", length=0)
        axes.set_xlabel("reward per decision and unit of the feature")
    return figure
