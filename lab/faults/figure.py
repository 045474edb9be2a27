"""Way of the robot after an input has failed, with and without the guard."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from serd_app.report import style
from serd_app.report.style import new_figure
from serd_core.arrays import FloatArray

_SIDES = (("without", style.RED, "o", -0.17), ("with", style.BLUE, "s", 0.17))
_TICKS_M = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20)


@dataclass(frozen=True, eq=False)
class FaultWays:
    """Way (m) in each episode from the beginning of a fault to its end; (N,) each."""

    about: str
    unguarded_m: FloatArray
    guarded_m: FloatArray


def draw_fault_ways(faults: Sequence[FaultWays], watched_s: float) -> Figure:
    """One line per fault, one marker per episode, on a logarithmic axis; a bar at each median."""
    with style.report_style():
        figure = new_figure(7.6, 0.9 + 0.42 * len(faults))
        axes = figure.subplots()
        for row, fault in enumerate(faults):
            for values, (_, colour, marker, offset) in zip(
                (fault.unguarded_m, fault.guarded_m), _SIDES, strict=True
            ):
                place = np.full(len(values), row + offset)
                way_m = np.maximum(values, _TICKS_M[0] / 2)
                axes.plot(way_m, place, marker, color=colour, alpha=0.45, markersize=4)
                if len(values):
                    axes.plot(2 * [np.median(way_m)], row + offset + np.array([-0.14, 0.14]),
                              color=colour, linewidth=2.2)  # fmt: skip
        axes.set_yticks(range(len(faults)), [fault.about for fault in faults])
        axes.invert_yaxis()
        axes.set_xscale("log")
        axes.set_xlim(left=min(0.19, axes.get_xlim()[0]))
        axes.xaxis.set_major_locator(FixedLocator(_TICKS_M))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.grid(axis="x")
        axes.tick_params(axis="y", length=0)
        axes.set_xlabel(f"way within {watched_s:g} s after the fault, m")
        for name, colour, marker, _ in _SIDES:
            axes.plot([], [], marker, color=colour, label=f"{name} the guard")
        axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, frameon=False)
    return figure
