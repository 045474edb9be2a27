"""Map axes: metres, equal aspect, walkable floor, walls and named areas under every map figure."""

import math
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle
from matplotlib.path import Path
from matplotlib.ticker import MultipleLocator

from serd_app.report import style
from serd_app.report.style import Look, new_figure
from serd_core.arrays import BoolArray, FloatArray
from serd_core.grid.grid import DIRECTION_VECTORS, Action, Grid
from serd_sim.scenario.scenario import Scenario

#: Of the outline of cells.
OUTLINE_DASHES = (0, (2, 1))
_MARGIN_M = 0.5
#: From the edge of an area to where its name may stand.
_BESIDE_M = 0.4
#: Between ticks, or a multiple of it where there would be more of them.
_TICKS_M, _MOST_TICKS = 4.0, 15
_GAP_IN, _SIDE_IN, _FOOT_IN, _HEIGHT_IN = 0.3, 0.85, 1.3, 7.3
_TITLE_HEIGHT_IN, _TITLE_WIDTH_IN, _LEGEND_WIDTH_IN = 0.45, 1.4, 4.3
_LONGER_SIDE_IN, _SHORTEST_SIDE_IN = 5.5, 2.5
_ROOM_IN = 1.2


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
    axes.add_patch(Polygon(floor, **outline))
    for obstacle in obstacles:
        axes.add_patch(Polygon(obstacle, facecolor=style.WALL, gid="obstacle", **wall))
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
    look: Look = {"edgecolor": "#ffffff", "linewidth": 0.4, "zorder": 1}
    squares = cell_squares(grid.centers_m, grid.cell_size_m)
    cells = PatchCollection(squares, cmap=colour_map, norm=norm, **look)
    cells.set_array(np.asarray(values, dtype=np.float64))
    axes.add_collection(cells)
    if scenario is None:
        axes.autoscale_view()
    return figure, axes, cells


def _fitted_figure(grid: Grid) -> tuple[Figure, Axes]:
    """A figure of the grid's proportions and its axes."""
    rows, columns = grid.walkable.shape
    width_in, height_in = np.maximum(
        np.array([columns, rows]) * _LONGER_SIDE_IN / max(columns, rows), _SHORTEST_SIDE_IN
    )
    figure = new_figure(float(width_in) + _ROOM_IN, float(height_in) + _ROOM_IN)
    axes = figure.subplots()
    axes.set(aspect="equal", xlabel="x in m", ylabel="y in m")
    return figure, axes


def draw_areas(axes: Axes, scenario: Scenario, *, filled: bool) -> None:
    """The goal area and the dashed start areas: filled and named, or as outlines over data."""
    starts = zip(scenario.start_areas_m.items(), cycle(style.START_COLOURS), strict=False)
    areas = [("goal", scenario.goal_area_m, style.GOAL_COLOUR)]
    areas += [(f"start\n{name}", corners, colour) for (name, corners), colour in starts]
    floor = Path(scenario.wall_polygons_m[0])
    for name, corners, colour in areas:
        polygon = np.array(corners)
        look: Look = {"edgecolor": colour, "linewidth": 1.4, "zorder": 2}
        look |= {"linestyle": "-" if name == "goal" else "--"}
        look |= {"facecolor": colour + "26" if filled else "none"}
        label = name.replace("\n", " ")
        axes.add_patch(Polygon(polygon, gid=f"area {name}", label=label, **look))
        if filled:
            _label_area(axes, name, polygon, colour, floor)


def cell_squares(centers_m: FloatArray, side_m: float) -> list[Rectangle]:
    """The square around each of the (N, 2) centres."""
    return [Rectangle((x - side_m / 2, y - side_m / 2), side_m, side_m) for x, y in centers_m]


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


def draw_vectors(axes: Axes, from_m: FloatArray, shift_m: FloatArray, **look: Any) -> None:
    """Arrows from (N, 2) places over (N, 2) shifts in metres; look: as `Axes.quiver` has it."""
    axes.quiver(
        *from_m.T, *shift_m.T, angles="xy", scale_units="xy", scale=1.0, units="inches", **look
    )


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


def _label_area(axes: Axes, name: str, polygon: FloatArray, colour: str, floor: Path) -> None:
    """The name below or above the area where that is outside the floor, else on it."""
    (left, bottom), (right, top) = polygon.min(axis=0), polygon.max(axis=0)
    x, y, aligned = (left + right) / 2, (bottom + top) / 2, "center"
    for edge, beyond, vertical in ((bottom, -_BESIDE_M, "top"), (top, _BESIDE_M, "bottom")):
        if not floor.contains_point((x, edge + beyond)):
            y, aligned, name = edge + beyond / 2, vertical, name.replace("\n", " ")
            break
    look: Look = {"fontsize": 7.5, "fontweight": "bold", "ha": "center", "va": aligned}
    look["bbox"] = {"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 1.0}
    axes.text(x, y, name, color=colour, zorder=10, parse_math=False, **look)
