"""How learning went on: the objective after every accepted step of the ascent."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from report import style
from report.canvas import new_figure
from report.errors import ReportError
from serd_core.arrays import FloatArray, float_array


def draw_progress(objective_trace: FloatArray, *, converged: bool) -> Figure:
    """objective_trace (n_steps,): log posterior after each step; the last point is the fit."""
    trace = float_array("objective_trace", objective_trace, (None,))
    if not len(trace):
        raise ReportError("objective_trace must have at least one step, got none; run the fit")
    with style.report_style():
        figure = new_figure(5.6, 2.9)
        axes = figure.subplots()
        steps = np.arange(1, len(trace) + 1)
        axes.plot(steps, trace, color=style.BLUE, linewidth=1.8, gid="objective")
        axes.plot(steps[-1:], trace[-1:], "o", color=style.BLUE, markersize=6)
        ending = "converged" if converged else "stopped early"
        axes.annotate(
            f"{trace[-1]:.2f}, {ending}".replace("-", "\N{MINUS SIGN}"),
            (steps[-1], trace[-1]),
            xytext=(-6, -14),
            textcoords="offset points",
            ha="right",
            fontsize=8.5,
        )
        low = np.percentile(trace, 5) if len(trace) > 20 else trace.min()
        span = max(trace[-1] - low, 1e-3 * abs(trace[-1]), 1e-9)
        axes.set_ylim(low - 0.05 * span, trace.max() + 0.12 * span)
        axes.xaxis.set_major_locator(MaxNLocator(nbins=7, integer=True, steps=[1, 2, 5, 10]))
        axes.grid(axis="y")
        axes.set_xlabel("step")
        axes.set_ylabel("objective (log posterior)")
    return figure
