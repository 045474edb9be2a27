"""Predicted against measured distribution of the time of arrival (Fig. 5.10)."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from report import style
from report.canvas import new_figure
from report.errors import ReportError
from serd_core.arrays import FloatArray, float_array


@dataclass(frozen=True, eq=False)
class ArrivalCurve:
    """A step function P(arrived by time) with a pointwise band; all (T,), times increasing."""

    time_s: FloatArray
    probability: FloatArray
    lower: FloatArray
    upper: FloatArray

    def __post_init__(self) -> None:
        length = len(self.time_s)
        for name in ("time_s", "probability", "lower", "upper"):
            column = float_array(f"{name} of an arrival curve", getattr(self, name), (length,))
            if name != "time_s" and not ((column >= -1e-9) & (column <= 1 + 1e-9)).all():
                raise ReportError(
                    f"{name} of an arrival curve must lie in [0, 1], got up to {column.max()}; "
                    "pass probabilities, not counts"
                )
            object.__setattr__(self, name, column)


def draw_arrival(
    predicted: ArrivalCurve, measured: ArrivalCurve, *, n_episodes: int, shown_until_s: float
) -> Figure:
    """Both curves as steps with their 95 % bands; what stays below 1 never arrived in time."""
    with style.report_style():
        figure = new_figure(7.2, 3.9)
        axes = figure.subplots()
        curves = (
            ("predicted by the learned model", predicted, style.PREDICTED_COLOUR, "--"),
            (f"measured in {n_episodes} episodes", measured, style.MEASURED_COLOUR, "-"),
        )
        for label, curve, colour, line in curves:
            axes.fill_between(
                curve.time_s,
                curve.lower,
                curve.upper,
                step="post",
                color=colour,
                alpha=0.18,
                linewidth=0,
                label=f"95 % band, {label.split()[0]}",
            )
            axes.step(
                curve.time_s,
                curve.probability,
                where="post",
                color=colour,
                linestyle=line,
                linewidth=2.0,
                label=label,
            )
        axes.set_xlim(0, shown_until_s)
        axes.set_ylim(0, 1.03)
        axes.set_yticks(np.linspace(0, 1, 5))
        axes.grid()
        axes.set_xlabel("time since the start in s")
        axes.set_ylabel("probability of having arrived")
        _legend_lines_first(axes)
    return figure


def _legend_lines_first(axes: Axes) -> None:
    handles, labels = axes.get_legend_handles_labels()
    order = sorted(range(len(labels)), key=lambda i: labels[i].startswith("95"))
    axes.legend([handles[i] for i in order], [labels[i] for i in order], loc="upper left")
