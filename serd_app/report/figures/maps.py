"""Maps of values per cell: visitation (Fig. 5.7), policy (5.11), flow, gain; plans of scenarios."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from serd_app.report import style
from serd_app.report.figures.map_axes import (
    cell_map,
    cell_squares,
    colour_bar_below,
    draw_areas,
    draw_vectors,
    map_figure,
    outline_traps,
)
from serd_app.report.style import Look
from serd_bag.quantities import counted
from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_core.grid.grid import DIRECTION_VECTORS, Action, Grid
from serd_core.grid.navigation import NO_FLOW
from serd_sim.crowd.routes import offset_loop
from serd_sim.scenario.polygon import edges_of
from serd_sim.scenario.scenario import Scenario

_LOOKS = ((style.PERSON_COLOUR, "-"), (style.PURPLE, "--"), (style.CYAN, "-."), (style.INK, ":"))
#: Loops that share a leg are drawn side by side.
_BESIDE_M = 0.13
_ARROW_EVERY_M = 4.0
_LARGEST_GRID = 4000
#: Widest shaft of an arrow, and the same in sides of its cell.
_SHAFT_IN, _SLENDER = 0.016, 0.11


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


def draw_gain(scenario: Scenario | None, grid: Grid, gain_nats: FloatArray) -> Figure:
    """What a demonstration from each cell (S,) is expected to add, the best start marked."""
    with style.report_style():
        norm = Normalize(0, max(gain_nats.max(), 1e-9))
        figure, axes, cells = cell_map(grid, scenario, gain_nats, norm, style.VISITS_MAP)
        star: Look = {"markeredgecolor": "white", "markersize": 13, "zorder": 5}
        axes.plot(*grid.centers_m[int(gain_nats.argmax())], "*", color=style.BLUE, **star)
        colour_bar_below(figure, axes, cells, "expected information in nats")
        axes.set_title("a demonstration from the star teaches most", loc="left")
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
) -> None:
    """Arrows of the moves and dots of the waits of a greedy policy (S,), red where trapped."""
    rows, columns = grid.walkable.shape
    panel = axes.get_window_extent()
    cell_in = min(panel.width / columns, panel.height / rows) / axes.figure.dpi
    width_in = min(_SHAFT_IN, _SLENDER * float(cell_in))
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


def draw_scenario_plan(scenario: Scenario) -> Figure:
    """The empty place in metres; the legend names the loops and how many people walk each."""
    loops = scenario.pedestrians.loops
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
