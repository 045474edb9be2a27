"""Greedy policy as arrows on the value map, trap states marked (Fig. 5.11)."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from report import style
from report.figures.map_axes import (
    colour_bar,
    draw_areas,
    draw_cells,
    map_figure,
    outline_cells,
)
from report.layout import HallwayLayout
from report.wording import counted
from serd_core.arrays import BoolArray, FloatArray, IntArray, float_array
from serd_core.grid.grid import DIRECTION_VECTORS, Action, Grid


def draw_policy_map(
    layout: HallwayLayout,
    grid: Grid,
    value: FloatArray,
    greedy: IntArray,
    goal_states: IntArray,
    trapped: BoolArray,
) -> Figure:
    """value (S,) as shades of blue, greedy (S,) as arrows (dot = wait), trapped (S,) outlined."""
    values = float_array("value", value, (grid.n_states,))
    with style.report_style():
        figure, (axes,) = map_figure(layout, height_in=7.3, width_in=6.4)
        elsewhere = np.delete(values, goal_states)
        norm = Normalize(*_colour_range(elsewhere if len(elsewhere) else values))
        cells = draw_cells(axes, grid, values, norm, style.VALUE_MAP)
        draw_areas(axes, layout, filled=False)
        draw_arrows(axes, grid, greedy, np.isin(np.arange(grid.n_states), goal_states), trapped)
        outline_cells(axes, grid, np.flatnonzero(trapped).tolist(), style.RED, "trap")
        colour_bar(figure, axes, cells, "value of the cell (discounted reward)", extend="both")
        axes.set_title(_title(int(trapped.sum())))
    return figure


def _colour_range(values: FloatArray) -> tuple[float, float]:
    low, high = np.percentile(values, [2, 98])
    return (float(low), float(high)) if high > low else (float(low) - 0.5, float(low) + 0.5)


def _title(n_trapped: int) -> str:
    if not n_trapped:
        return "every arrow leads to the goal"
    return f"{counted(n_trapped, 'trap state')} (dashed red)"


def draw_arrows(
    axes: Axes,
    grid: Grid,
    greedy: IntArray,
    is_goal: BoolArray,
    trapped: BoolArray,
    width_in: float = 0.016,
) -> None:
    """Arrows of the moves and dots of the waits of a greedy policy (S,), red where trapped."""
    moving = (greedy != Action.WAIT) & ~is_goal
    waiting = (greedy == Action.WAIT) & ~is_goal
    colours = np.where(trapped, style.RED, style.INK)
    shift = 0.62 * grid.cell_size_m * DIRECTION_VECTORS[greedy[moving]]
    tail = grid.centers_m[moving] - shift / 2
    if moving.any():
        axes.quiver(
            *tail.T,
            *shift.T,
            angles="xy",
            scale_units="xy",
            scale=1.0,
            units="inches",
            width=width_in,
            headwidth=4.5,
            headlength=4.5,
            headaxislength=4.0,
            color=colours[moving].tolist(),
            zorder=5,
            gid="greedy moves",
        )
    x, y = grid.centers_m[waiting].T
    axes.scatter(x, y, s=1000 * width_in, c=colours[waiting].tolist(), zorder=5, gid="greedy waits")
