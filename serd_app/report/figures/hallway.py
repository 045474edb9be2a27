"""The plan of a scenario."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from serd_app.report import style
from serd_app.report.figures.map_axes import (
    cell_squares,
    draw_areas,
    map_figure,
)
from serd_app.report.style import Look
from serd_core.arrays import FloatArray
from serd_sim.crowd.routes import offset_loop
from serd_sim.scenario.polygon import edges_of
from serd_sim.scenario.scenario import Scenario

_LOOKS = ((style.PERSON_COLOUR, "-"), (style.PURPLE, "--"), (style.CYAN, "-."), (style.INK, ":"))
#: Loops that share a leg are drawn side by side.
_BESIDE_M = 0.13
_ARROW_EVERY_M = 4.0
_LARGEST_GRID = 4000


def draw_scenario_plan(scenario: Scenario) -> Figure:
    """The empty place in metres; the legend names the loops and how many people walk each."""
    loops = scenario.directed_loops
    with style.report_style():
        figure, axes = map_figure(scenario, width_in=7.3)
        _draw_cells(axes, scenario)
        draw_areas(axes, scenario, filled=True)
        handles = []
        for number, loop in enumerate(loops):
            colour, line = _LOOKS[number % len(_LOOKS)]
            beside_m = _BESIDE_M * (number - 0.5 * (len(loops) - 1))
            _draw_loop(axes, offset_loop(np.array(loop.waypoints_m), beside_m), colour, line)
            label = f"{loop.name} (share {loop.share:g}, lane \u00b1{loop.lane_half_width_m:g} m)"
            handles.append(Line2D([], [], color=colour, linestyle=line, label=label))
        axes.set_title(scenario.name)
        if handles:
            figure.legend(handles=handles, loc="outside lower center", handlelength=2.6)
    return figure


def _draw_cells(axes: Axes, scenario: Scenario) -> None:
    """The grid of decisions as hairlines, where it is not too fine to be seen."""
    cells = scenario.cells
    if cells.walkable.sum() > _LARGEST_GRID:
        return
    squares = cell_squares(cells.centers_m, cells.cell_size_m)
    look: Look = {"facecolor": "none", "edgecolor": style.HAIRLINE, "linewidth": 0.6, "zorder": 1}
    axes.add_collection(PatchCollection(squares, **look))


def _draw_loop(axes: Axes, corners_m: FloatArray, colour: str, line: str) -> None:
    closed = np.vstack([corners_m, corners_m[:1]])
    axes.plot(*closed.T, color=colour, linestyle=line, linewidth=1.3, zorder=4, gid="loop")
    arrow = {"arrowstyle": "-|>", "color": colour, "shrinkA": 0, "shrinkB": 0}
    for start, end in edges_of(corners_m):
        length_m = float(np.hypot(*(end - start)))
        count = max(1, round(length_m / _ARROW_EVERY_M))
        for share in (np.arange(count) + 0.5) / count:
            tip = start + share * (end - start) + 0.2 * (end - start) / length_m
            tail = tip - 0.4 * (end - start) / length_m
            axes.annotate("", xy=tip, xytext=tail, arrowprops=arrow, zorder=5)
