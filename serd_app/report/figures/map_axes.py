"""Map axes: metres, equal aspect, walkable floor, walls and named areas under every map figure."""

import math
from collections.abc import Sequence
from itertools import cycle
from operator import itemgetter
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
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
_GAP_IN, _SIDE_IN, _FOOT_IN = 0.3, 0.85, 1.3
_TITLE_HEIGHT_IN, _TITLE_WIDTH_IN, _LEGEND_WIDTH_IN = 0.45, 1.4, 4.3
_LONGER_SIDE_IN, _SHORTEST_SIDE_IN = 5.5, 2.5
_ROOM_IN = 1.2


def map_figure(
    scenario: Scenario, n_panels: int = 1, *, height_in: float, width_in: float
) -> tuple[Figure, list[Axes]]:
    """A figure of `n_panels` equal map axes, arranged to be as large as the given space allows."""
    rows, columns, size_in = _arranged(scenario, n_panels, width_in, height_in)
    figure = new_figure(*size_in)
    with style.report_style():
        grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    axes = list(grid.ravel())
    for spare in axes[n_panels:]:
        spare.remove()
    for each in axes[:n_panels]:
        draw_layout(each, scenario)
    return figure, axes[:n_panels]


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
        figure, (axes,) = map_figure(scenario, height_in=7.3, width_in=6.4)
        if areas:
            draw_areas(axes, scenario, filled=False)
    cells = draw_cells(axes, grid, values, norm, colour_map)
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


def _arranged(
    scenario: Scenario, n_panels: int, width_in: float, height_in: float
) -> tuple[int, int, tuple[float, float]]:
    """Rows, columns, and the size with room for titles, labels and a colour bar or legend."""
    x_min, y_min, x_max, y_max = scenario.bounds_m
    width_m, height_m = x_max - x_min + 2 * _MARGIN_M, y_max - y_min + 2 * _MARGIN_M
    candidates = []
    for columns in range(1, n_panels + 1):
        rows = math.ceil(n_panels / columns)
        across = (width_in - _SIDE_IN - columns * _GAP_IN) / (columns * width_m)
        upright = (height_in - _FOOT_IN - rows * _TITLE_HEIGHT_IN) / (rows * height_m)
        candidates.append((max(min(across, upright), 0.01), rows, columns))
    scale, rows, columns = max(candidates, key=itemgetter(0))
    pitch_in = max(width_m * scale + _GAP_IN, _TITLE_WIDTH_IN)
    size_in = max(columns * pitch_in + _SIDE_IN, _LEGEND_WIDTH_IN)
    return rows, columns, (size_in, rows * (height_m * scale + _TITLE_HEIGHT_IN) + _FOOT_IN)


def draw_layout(axes: Axes, scenario: Scenario) -> None:
    """Floor, walls, obstacles and axes in metres."""
    floor, *obstacles = scenario.wall_polygons_m
    axes.add_patch(Polygon(floor, facecolor=style.FLOOR, edgecolor="none", zorder=0))
    wall: Look = {"edgecolor": style.WALL, "zorder": 6}
    outline = wall | {"fill": False, "linewidth": 2.2, "joinstyle": "miter", "gid": "wall"}
    axes.add_patch(Polygon(floor, **outline))
    for obstacle in obstacles:
        axes.add_patch(Polygon(obstacle, facecolor=style.WALL, gid="obstacle", **wall))
    _frame(axes, scenario)


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


def area_legend(figure: Figure, axes: Axes, others: Sequence[Artist] = ()) -> None:
    """What the outlines of areas in a map are, and others, below all of the figure."""
    areas = [each for each in axes.patches if str(each.get_gid()).startswith("area ")]
    handles = [*areas, *others]
    if handles:
        figure.legend(
            handles=handles, loc="outside lower center", ncols=3 + len(others), handlelength=1.6
        )


def cell_squares(centers_m: FloatArray, side_m: float) -> list[Rectangle]:
    """The square around each of the (N, 2) centres."""
    return [Rectangle((x - side_m / 2, y - side_m / 2), side_m, side_m) for x, y in centers_m]


def draw_cells(
    axes: Axes, grid: Grid, values: FloatArray, norm: Normalize, colour_map: object
) -> PatchCollection:
    """Every state's cell filled by its value (S,); returns the collection for a colour bar."""
    look: Look = {"edgecolor": "#ffffff", "linewidth": 0.4, "zorder": 1}
    squares = cell_squares(grid.centers_m, grid.cell_size_m)
    collection = PatchCollection(squares, cmap=colour_map, norm=norm, **look)
    collection.set_array(np.asarray(values, dtype=np.float64))
    axes.add_collection(collection)
    return collection


def colour_bar(
    figure: Figure, axes: Axes | Sequence[Axes], cells: ScalarMappable, label: str, **look: Any
) -> None:
    """A slim colour bar without a frame; look: as `Figure.colorbar` has it."""
    bar = figure.colorbar(cells, ax=axes, **look)
    bar.set_label(label)
    bar.outline.set_visible(False)


def colour_bar_below(
    figure: Figure,
    axes: Axes | Sequence[Axes],
    cells: PatchCollection,
    label: str,
    extend: str = "neither",
) -> None:
    """A horizontal colour bar under the map, or under several, and the names of their areas."""
    n_maps = 1 if isinstance(axes, Axes) else min(len(axes), 3)
    area_legend(figure, axes if isinstance(axes, Axes) else axes[0])
    look = {"location": "bottom", "shrink": 0.85, "pad": 0.02, "aspect": 35 * n_maps}
    colour_bar(figure, axes, cells, label, extend=extend, **look)


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
    axes.label_outer()
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
