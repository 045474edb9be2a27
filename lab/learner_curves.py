"""Curves of learners over the number of demonstrations: one style per learner in all figures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from serd_app.report.style import BLUE, CYAN, GREEN, INK, MUTED, PURPLE, RED, YELLOW
from serd_core import plots
from serd_core.arrays import FloatArray


@dataclass(frozen=True)
class LearnerStyle:
    """Colour, marker and line of one learner; any two differ in more than colour."""

    colour: str
    marker: str
    line: str = "-"

    @property
    def arguments(self) -> dict[str, Any]:
        """Keyword arguments of matplotlib's line functions."""
        return {"color": self.colour, "marker": self.marker, "linestyle": self.line}


_SERD = LearnerStyle(BLUE, "o")
_FREE_SERD = LearnerStyle(CYAN, "D")
_IRL = LearnerStyle(PURPLE, "s", "--")
STYLES = {
    "MDCE SERD": _SERD,
    "PM SERD, regularised": _SERD,
    "SERD, free belief": _FREE_SERD,
    "SERD, evidence": LearnerStyle(INK, "P"),
    "SERD, averaged": LearnerStyle(MUTED, "h", ":"),
    "MDCE SERD, mode A": _FREE_SERD,
    "MDCE SERD, mode B": _SERD,
    "PM SERD": LearnerStyle(CYAN, "P"),
    "MDCE IRL": _IRL,
    "IRL, same prior": LearnerStyle(RED, "^", "--"),
    "MDCE IRL, likelihood": _IRL,
    "MDCE IRL, entropy": LearnerStyle(RED, "^", "--"),
    "REIRL": LearnerStyle(GREEN, "v", "-."),
    "cloning": LearnerStyle(YELLOW, "X", ":"),
}


def draw_band(axes: Axes, sizes: Sequence[int], curve: Mapping[str, Any], learner: str) -> None:
    """Draw columns `median`, `lower` and `upper` over the sizes: a line with a band around it."""
    look = STYLES[learner].arguments | {"markeredgecolor": INK, "markeredgewidth": 0.4}
    band = np.stack([curve[name] for name in ("lower", "median", "upper")])
    plots.learning_curve(sizes, band, axes, **look, label=learner)


def draw_intervals(
    axes: Axes, sizes: FloatArray, values: Sequence[FloatArray], learner: str, place: float
) -> None:
    """Draw (lower, middle, upper) as a line with error bars, shifted sideways by `place`.

    place: 0 for no shift; curves of neighbouring places do not cover each other's error bars.
    """
    look = STYLES[learner].arguments | {"markersize": 5, "linewidth": 1.4, "elinewidth": 1.0}
    plots.intervals(np.asarray(sizes) * 1.04**place, values, axes, **look, label=learner)


def tick_sizes(axes: Axes, sizes: Sequence[int]) -> None:
    """Label a logarithmic x axis with these sizes and nothing between."""
    axes.set_xticks(sizes, [str(size) for size in sizes])
    axes.set_xticks([], minor=True)
