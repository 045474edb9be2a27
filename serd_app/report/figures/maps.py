"""Maps of values per cell: visitation (Fig. 5.7), policy (5.11) and flow."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from serd_app.report import style
from serd_app.report.figures.map_axes import (
    cell_map,
    colour_bar_below,
    draw_vectors,
    outline_traps,
)
from serd_bag.quantities import counted
from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_core.grid.grid import DIRECTION_VECTORS, Action, Grid
from serd_core.grid.navigation import NO_FLOW
from serd_sim.scenario.scenario import Scenario

#: Widest shaft of an arrow, in sides of its cell.
_SLENDER = 0.11


def draw_visitation(
    scenario: Scenario | None,
    grid: Grid,
    decisions_per_state: FloatArray,
    tracks_m: Sequence[FloatArray] = (),
) -> Figure:
    """Decisions taken per cell (S,) in shades of red, tracks (T, 2) as thin lines.

    scenario: that of the place; where it is None, a dot marks the start of each track.
    """
    with style.report_style():
        norm = Normalize(0, max(decisions_per_state.max(), 1))
        figure, axes, cells = cell_map(grid, scenario, decisions_per_state, norm, style.VISITS_MAP)
        for track in tracks_m:
            axes.plot(*track.T, color=style.INK, linewidth=0.7, alpha=0.55, zorder=4, gid="track")
            if scenario is None:
                axes.plot(*track[0], "o", color=style.INK, markersize=4, zorder=5)
        colour_bar_below(figure, axes, cells, "decisions taken in the cell")
        n_tracks = f", {counted(len(tracks_m), 'track')}" if len(tracks_m) else ""
        axes.set_title(f"{int(decisions_per_state.sum())} decisions{n_tracks}")
    return figure


def draw_policy_map(
    scenario: Scenario,
    grid: Grid,
    value: FloatArray,
    greedy: IntArray,
    goal_states: IntArray,
    trapped: BoolArray,
    whose: str = "",
) -> Figure:
    """value (S,) as shades of blue, greedy (S,) as arrows (dot = wait), trapped (S,) outlined.

    whose: policy that is trapped, for the title, where the arrows are not its own.
    """
    with style.report_style():
        elsewhere = np.delete(value, goal_states)
        low, high = np.percentile(elsewhere if len(elsewhere) else value, [2, 98])
        norm = Normalize(low, high) if high > low else Normalize(low - 0.5, low + 0.5)
        figure, axes, cells = cell_map(grid, scenario, value, norm, style.VALUE_MAP)
        draw_arrows(axes, grid, greedy, np.isin(np.arange(grid.n_states), goal_states), trapped)
        outline_traps(axes, grid, trapped)
        colour_bar_below(
            figure, axes, cells, "value of the cell (discounted reward)", extend="both"
        )
        n_traps = counted(int(trapped.sum()), "trap state")
        axes.set_title(
            f"{n_traps}{whose} (dashed red)" if trapped.any() else "every arrow leads to the goal"
        )
    return figure


def draw_arrows(
    axes: Axes,
    grid: Grid,
    greedy: IntArray,
    is_goal: BoolArray,
    trapped: BoolArray,
    width_in: float = 0.016,
) -> None:
    """Arrows of the moves and dots of the waits of a greedy policy (S,), red where trapped."""
    rows, columns = grid.walkable.shape
    panel = axes.get_window_extent()
    cell_in = min(panel.width / columns, panel.height / rows) / axes.figure.dpi
    width_in = min(width_in, _SLENDER * float(cell_in))
    moving = (greedy != Action.WAIT) & ~is_goal
    waiting = (greedy == Action.WAIT) & ~is_goal
    colours = np.where(trapped, style.RED, style.INK)
    shift = 0.8 * grid.cell_size_m * DIRECTION_VECTORS[greedy[moving]]
    tail = grid.centers_m[moving] - shift / 2
    if moving.any():
        heads = {"headwidth": 4.5, "headlength": 4.5, "headaxislength": 4.0}
        look = {"color": colours[moving].tolist(), "zorder": 5, "gid": "greedy moves"}
        draw_vectors(axes, tail, shift, width=width_in, **heads, **look)
    x, y = grid.centers_m[waiting].T
    axes.scatter(x, y, s=1000 * width_in, c=colours[waiting].tolist(), zorder=5, gid="greedy waits")


def draw_flow_map(
    grid: Grid,
    flow: IntArray,
    order: FloatArray,
    *,
    scenario: Scenario | None = None,
    scenario_flow: IntArray | None = None,
) -> Figure:
    """flow (S,) as arrows (dot = none), order (S,) 0 to 1 in shades of blue.

    scenario: that of the place where one is known. scenario_flow: (S,) that of the scenario; arrows
    that differ from it are red.
    """
    differing = np.zeros(grid.n_states, dtype=bool)
    if scenario_flow is not None:
        differing = (flow != scenario_flow) & (flow != NO_FLOW)
    with style.report_style():
        norm = Normalize(0, 1)
        figure, axes, cells = cell_map(grid, scenario, order, norm, style.VALUE_MAP, areas=False)
        arrows = np.where(flow == NO_FLOW, int(Action.WAIT), flow)
        draw_arrows(axes, grid, arrows, np.zeros(grid.n_states, dtype=bool), differing)
        colour_bar_below(figure, axes, cells, "1: all walk the same way, 0: they cancel")
        title = f"flow known in {int((flow != NO_FLOW).sum())} of {len(flow)} cells"
        if scenario_flow is not None:
            title += f",\n{int(differing.sum())} not the scenario's (red)"
        axes.set_title(title)
    return figure
