"""Maps: metres, equal aspect, walkable floor, walls and named areas; below them values per cell.

Visitation (Fig. 5.7), policy (5.11), flow of people, information, and plans of scenarios.
"""

import math
from collections.abc import Sequence
from itertools import cycle
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon, Rectangle
from matplotlib.path import Path as Outline
from matplotlib.ticker import MultipleLocator

from serd_app.places.map_scenario import FITTED
from serd_app.report import style
from serd_app.report.style import Look, new_figure, save_figure
from serd_bag.quantities import counted
from serd_core import plots
from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_core.grid.grid import DIRECTION_VECTORS, Action, Grid
from serd_core.grid.navigation import NO_FLOW
from serd_sim.crowd.routes import offset_loop
from serd_sim.scenario.polygon import edges_of
from serd_sim.scenario.scenario import Scenario

#: Of the outline of cells.
OUTLINE_DASHES = (0, (2, 1))
_MARGIN_M = 0.5
#: From the edge of an area to where its name may stand.
_NAME_BESIDE_M = 0.4
#: Between ticks, or a multiple of it where there would be more of them.
_TICKS_M, _MOST_TICKS = 4.0, 15
_GAP_IN, _SIDE_IN, _FOOT_IN, _HEIGHT_IN = 0.3, 0.85, 1.3, 7.3
_TITLE_HEIGHT_IN, _TITLE_WIDTH_IN, _LEGEND_WIDTH_IN = 0.45, 1.4, 4.3
_LONGER_SIDE_IN, _SHORTEST_SIDE_IN = 5.5, 2.5
_ROOM_IN = 1.2
_LOOKS = ((style.PERSON_COLOUR, "-"), (style.PURPLE, "--"), (style.CYAN, "-."), (style.INK, ":"))
#: Between loops that share a leg, which are drawn side by side.
_LOOPS_BESIDE_M = 0.13
_ARROW_EVERY_M = 4.0
_LARGEST_GRID = 4000
#: Action of a state without an arrow.
NO_ARROW = -1


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
) -> Figure:
    """value (S,) as shades of blue, greedy (S,) as arrows (dot = wait).

    trapped: (S,) from which the learned policy does not arrive, which are outlined.
    """
    with style.report_style():
        elsewhere = np.delete(value, goal_states)
        low, high = np.percentile(elsewhere if len(elsewhere) else value, [2, 98])
        norm = Normalize(low, high) if high > low else Normalize(low - 0.5, low + 0.5)
        figure, axes, cells = cell_map(grid, scenario, value, norm, style.VALUE_MAP)
        shown = greedy.copy()
        shown[goal_states] = NO_ARROW
        plots.policy(shown, grid, axes, colours=_inks(trapped))
        outline_traps(axes, grid, trapped)
        colour_bar_below(
            figure, axes, cells, "value of the cell (discounted reward)", extend="both"
        )
        n_traps = counted(int(trapped.sum()), "trap state")
        axes.set_title(
            f"{n_traps} of the learned policy (dashed red)"
            if trapped.any()
            else "every arrow leads to the goal"
        )
    return figure


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
        plots.policy(arrows, grid, axes, colours=_inks(differing))
        colour_bar_below(figure, axes, cells, "1: all walk the same way, 0: they cancel")
        title = f"flow known in {int((flow != NO_FLOW).sum())} of {len(flow)} cells"
        if scenario_flow is not None:
            title += f",\n{int(differing.sum())} not the scenario's (red)"
        axes.set_title(title)
    return figure


def save_plan(path: Path, scenario: Scenario) -> None:
    """Draw a scenario from above as PNG; its folder is made."""
    save_figure(path, draw_scenario_plan(scenario))


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
            beside_m = _LOOPS_BESIDE_M * (number - 0.5 * (len(loops) - 1))
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
    side_m, corners_m = cells.cell_size_m, cells.centers_m - cells.cell_size_m / 2
    squares = [Rectangle(corner, side_m, side_m) for corner in corners_m]
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


def map_figure(scenario: Scenario, width_in: float = 6.4) -> tuple[Figure, Axes]:
    """A figure with one map of a place, as large as a page allows: floor, walls, obstacles."""
    x_min, y_min, x_max, y_max = scenario.bounds_m
    width_m, height_m = x_max - x_min + 2 * _MARGIN_M, y_max - y_min + 2 * _MARGIN_M
    across = (width_in - _SIDE_IN - _GAP_IN) / width_m
    upright = (_HEIGHT_IN - _FOOT_IN - _TITLE_HEIGHT_IN) / height_m
    scale = max(min(across, upright), 0.01)
    pitch_in = max(width_m * scale + _GAP_IN, _TITLE_WIDTH_IN)
    size_in = max(pitch_in + _SIDE_IN, _LEGEND_WIDTH_IN)
    figure = new_figure(size_in, height_m * scale + _TITLE_HEIGHT_IN + _FOOT_IN)
    with style.report_style():
        axes = figure.subplots()
    floor, *obstacles = scenario.wall_polygons_m
    axes.add_patch(Polygon(floor, facecolor=style.FLOOR, edgecolor="none", zorder=0))
    wall: Look = {"edgecolor": style.WALL, "zorder": 6}
    outline = wall | {"fill": False, "linewidth": 2.2, "joinstyle": "miter", "gid": "wall"}
    solid: Look = {"facecolor": style.WALL, "gid": "obstacle", **wall}
    if scenario.name == FITTED:  # the edge of visited cells is no wall
        edge: Look = {"edgecolor": style.MUTED, "linestyle": (0, (2, 2)), "zorder": 6}
        outline, solid = edge | {"fill": False}, edge | {"facecolor": style.PAPER}
    axes.add_patch(Polygon(floor, **outline))
    for obstacle in obstacles:
        axes.add_patch(Polygon(obstacle, **solid))
    _frame(axes, scenario)
    return figure, axes


def cell_map(
    grid: Grid,
    scenario: Scenario | None,
    values: FloatArray,
    norm: Normalize,
    colour_map: object,
    *,
    areas: bool = True,
) -> tuple[Figure, Axes, PatchCollection]:
    """A figure with one map of the place, or of the grid alone where no scenario is known.

    Its cells are filled by values (S,); areas: whether those of the scenario are outlined.
    """
    if scenario is None:
        figure, axes = _fitted_figure(grid)
    else:
        figure, axes = map_figure(scenario)
        if areas:
            draw_areas(axes, scenario, filled=False)
    plots.values(values, grid, axes, label="", cmap=colour_map, norm=norm, alpha=None)
    (cells,) = (each for each in axes.collections if isinstance(each, PatchCollection))
    return figure, axes, cells


def _inks(marked: BoolArray) -> list[str]:
    """Colour of the arrow of each state (S,), red where it is marked."""
    return [style.RED if each else style.INK for each in marked]


def _fitted_figure(grid: Grid) -> tuple[Figure, Axes]:
    """A figure of the grid's proportions and its axes."""
    rows, columns = grid.walkable.shape
    width_in, height_in = np.maximum(
        np.array([columns, rows]) * _LONGER_SIDE_IN / max(columns, rows), _SHORTEST_SIDE_IN
    )
    figure = new_figure(float(width_in) + _ROOM_IN, float(height_in) + _ROOM_IN)
    axes = figure.subplots()
    return figure, axes


def draw_areas(axes: Axes, scenario: Scenario, *, filled: bool) -> None:
    """The goal area and the dashed start areas: filled and named, or as outlines over data."""
    starts = zip(scenario.start_areas_m.items(), cycle(style.START_COLOURS), strict=False)
    areas = [("goal", scenario.goal_area_m, style.GOAL_COLOUR)]
    areas += [(f"start\n{name}", corners, colour) for (name, corners), colour in starts]
    floor = Outline(scenario.wall_polygons_m[0])
    for name, corners, colour in areas:
        polygon = np.array(corners)
        look: Look = {"edgecolor": colour, "linewidth": 1.4, "zorder": 2}
        look |= {"linestyle": "-" if name == "goal" else "--"}
        look |= {"facecolor": colour + "26" if filled else "none"}
        label = name.replace("\n", " ")
        axes.add_patch(Polygon(polygon, gid=f"area {name}", label=label, **look))
        if filled:
            _label_area(axes, name, polygon, colour, floor)


def colour_bar_below(
    figure: Figure, axes: Axes, cells: PatchCollection, label: str, extend: str = "neither"
) -> None:
    """A slim horizontal colour bar under the map, and below it what the outlines of areas are."""
    areas = [each for each in axes.patches if str(each.get_gid()).startswith("area ")]
    if areas:
        figure.legend(handles=areas, loc="outside lower center", ncols=3, handlelength=1.6)
    look: Look = {"location": "bottom", "shrink": 0.85, "pad": 0.02, "aspect": 35}
    bar = figure.colorbar(cells, ax=axes, extend=extend, **look)
    bar.set_label(label)
    bar.outline.set_visible(False)


def outline_traps(axes: Axes, grid: Grid, trapped: BoolArray) -> None:
    """A dashed red line, a little inside, around the cells (S,) that lie side by side."""
    states, half = np.flatnonzero(trapped), 0.46 * grid.cell_size_m
    sides = []
    for action in (Action.NORTH, Action.EAST, Action.SOUTH, Action.WEST):
        beyond = grid.neighbours[states, action]
        at_border = states[(beyond == states) | ~np.isin(beyond, states)]
        across = DIRECTION_VECTORS[action]
        along = 0.5 * grid.cell_size_m * np.array([-across[1], across[0]])
        middle = grid.centers_m[at_border] + half * across
        sides.append(np.stack([middle - along, middle + along], axis=1))
    look = {"colors": style.RED, "linewidths": 1.3, "linestyles": [OUTLINE_DASHES]}
    axes.add_collection(LineCollection(list(np.concatenate(sides)), zorder=5, gid="trap", **look))


def _frame(axes: Axes, scenario: Scenario) -> None:
    x_min, y_min, x_max, y_max = scenario.bounds_m
    axes.set(aspect="equal", xlabel="x in m", ylabel="y in m")
    axes.set_xlim(x_min - _MARGIN_M, x_max + _MARGIN_M)
    axes.set_ylim(y_min - _MARGIN_M, y_max + _MARGIN_M)
    longest_m = max(x_max - x_min, y_max - y_min)
    step_m = _TICKS_M * 2.0 ** max(0, math.ceil(math.log2(longest_m / (_MOST_TICKS * _TICKS_M))))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MultipleLocator(step_m))
    axes.tick_params(length=3)
    for spine in axes.spines.values():
        spine.set_visible(False)


def _label_area(axes: Axes, name: str, polygon: FloatArray, colour: str, floor: Outline) -> None:
    """The name below or above the area where that is outside the floor, else on it."""
    (left, bottom), (right, top) = polygon.min(axis=0), polygon.max(axis=0)
    x, y, aligned = (left + right) / 2, (bottom + top) / 2, "center"
    for edge, beyond, vertical in (
        (bottom, -_NAME_BESIDE_M, "top"),
        (top, _NAME_BESIDE_M, "bottom"),
    ):
        if not floor.contains_point((x, edge + beyond)):
            y, aligned, name = edge + beyond / 2, vertical, name.replace("\n", " ")
            break
    look: Look = {"fontsize": 7.5, "fontweight": "bold", "ha": "center", "va": aligned}
    look["bbox"] = {"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 1.0}
    axes.text(x, y, name, color=colour, zorder=10, parse_math=False, **look)
