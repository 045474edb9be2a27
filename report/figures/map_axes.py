"""Map axes: metres, equal aspect, walkable floor, walls and named areas under every map figure."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle
from matplotlib.ticker import MultipleLocator

from report import style
from report.canvas import new_figure
from report.layout import HallwayLayout
from serd_core.arrays import FloatArray, IntArray
from serd_core.grid.grid import DIRECTION_VECTORS, Action, Grid

_MARGIN_M = 0.5
_GAP_IN, _SIDE_IN, _FOOT_IN = 0.3, 0.85, 1.0
_TITLE_HEIGHT_IN, _TITLE_WIDTH_IN, _LEGEND_WIDTH_IN = 0.45, 1.4, 4.3


def map_figure(
    layout: HallwayLayout, n_panels: int = 1, *, height_in: float, width_in: float
) -> tuple[Figure, list[Axes]]:
    """A figure of `n_panels` equal map axes, arranged to be as large as the given space allows."""
    panels = _arranged(layout, n_panels, width_in, height_in)
    figure = new_figure(*panels.figure_size_in)
    with style.report_style():
        grid = figure.subplots(panels.rows, panels.columns, squeeze=False, sharex=True, sharey=True)
    axes = list(grid.ravel())
    for spare in axes[n_panels:]:
        spare.remove()
    for each in axes[:n_panels]:
        draw_layout(each, layout)
    return figure, axes[:n_panels]


@dataclass(frozen=True)
class _Panels:
    """Rows and columns of equal maps of `size_m` at `scale` inches per metre."""

    rows: int
    columns: int
    size_m: tuple[float, float]
    scale: float

    @property
    def figure_size_in(self) -> tuple[float, float]:
        """Width and height with room for titles, labels and a colour bar or legend."""
        pitch = max(self.size_m[0] * self.scale + _GAP_IN, _TITLE_WIDTH_IN)
        width = max(self.columns * pitch + _SIDE_IN, _LEGEND_WIDTH_IN)
        return width, self.rows * (self.size_m[1] * self.scale + _TITLE_HEIGHT_IN) + _FOOT_IN


def _arranged(layout: HallwayLayout, n_panels: int, width_in: float, height_in: float) -> _Panels:
    x_min, y_min, x_max, y_max = layout.bounds_m
    size_m = x_max - x_min + 2 * _MARGIN_M, y_max - y_min + 2 * _MARGIN_M
    candidates = []
    for columns in range(1, n_panels + 1):
        rows = math.ceil(n_panels / columns)
        across = (width_in - _SIDE_IN - columns * _GAP_IN) / (columns * size_m[0])
        upright = (height_in - _FOOT_IN - rows * _TITLE_HEIGHT_IN) / (rows * size_m[1])
        candidates.append(_Panels(rows, columns, size_m, max(min(across, upright), 0.01)))
    return max(candidates, key=lambda panels: panels.scale)


def draw_layout(axes: Axes, layout: HallwayLayout) -> None:
    """Floor, walls, obstacles and axes in metres."""
    axes.add_patch(Polygon(layout.outline_m, facecolor=style.FLOOR, edgecolor="none", zorder=0))
    axes.add_patch(
        Polygon(
            layout.outline_m,
            fill=False,
            edgecolor=style.WALL,
            linewidth=2.2,
            zorder=6,
            joinstyle="miter",
            gid="wall",
        )
    )
    for obstacle in layout.obstacles_m:
        axes.add_patch(
            Polygon(obstacle, facecolor=style.WALL, edgecolor=style.WALL, zorder=6, gid="obstacle")
        )
    _frame(axes, layout)


def draw_areas(axes: Axes, layout: HallwayLayout, *, filled: bool) -> None:
    """The goal area and the dashed start areas: filled and named, or as outlines over data."""
    colours = _start_colours(layout)
    areas = [("goal", layout.goal_area_m, style.GOAL_COLOUR)]
    areas += [(f"start\n{name}", polygon, colours[name]) for name, polygon in layout.start_areas_m]
    for name, polygon, colour in areas:
        axes.add_patch(
            Polygon(
                polygon,
                facecolor=colour + "26" if filled else "none",
                edgecolor=colour,
                linewidth=1.4,
                linestyle="-" if name == "goal" else "--",
                zorder=2,
                gid=f"area {name}",
            )
        )
        if filled:
            _label_area(axes, name, polygon, colour)


def draw_cells(
    axes: Axes,
    grid: Grid,
    values: FloatArray,
    norm: Normalize,
    colour_map: object,
) -> PatchCollection:
    """Every state's cell filled by its value (S,); returns the collection for a colour bar."""
    side = grid.cell_size_m
    cells = [Rectangle((x - side / 2, y - side / 2), side, side) for x, y in grid.centers_m]
    collection = PatchCollection(
        cells, cmap=colour_map, norm=norm, edgecolor="#ffffff", linewidth=0.4, zorder=1
    )
    collection.set_array(np.asarray(values, dtype=np.float64))
    axes.add_collection(collection)
    return collection


def colour_bar(
    figure: Figure,
    axes: Axes | Sequence[Axes],
    cells: PatchCollection,
    label: str,
    extend: str = "neither",
) -> None:
    """A slim horizontal colour bar under the map, or under several."""
    aspect = 35 if isinstance(axes, Axes) else 35 * min(len(axes), 3)
    bar = figure.colorbar(
        cells, ax=axes, location="bottom", shrink=0.85, pad=0.02, aspect=aspect, extend=extend
    )
    bar.set_label(label)
    bar.outline.set_visible(False)


def outline_cells(axes: Axes, grid: Grid, states: Sequence[int], colour: str, gid: str) -> None:
    """A dashed line around the given states, one for all that lie side by side."""
    borders = list(_borders(grid, np.asarray(states, dtype=np.int64)))
    dashes = (0, (2, 1))
    axes.add_collection(
        LineCollection(
            borders, colors=colour, linewidths=1.3, linestyles=[dashes], zorder=5, gid=gid
        )
    )


def _borders(grid: Grid, states: IntArray) -> FloatArray:
    """(N, 2, 2) both ends of every side, a little inside, beyond which lies none of the states."""
    half = 0.46 * grid.cell_size_m
    sides = []
    for action in (Action.NORTH, Action.EAST, Action.SOUTH, Action.WEST):
        beyond = grid.neighbours[states, action]
        at_border = states[(beyond == states) | ~np.isin(beyond, states)]
        across = DIRECTION_VECTORS[action]
        along = 0.5 * grid.cell_size_m * np.array([-across[1], across[0]])
        middle = grid.centers_m[at_border] + half * across
        sides.append(np.stack([middle - along, middle + along], axis=1))
    return np.concatenate(sides)


def _frame(axes: Axes, layout: HallwayLayout) -> None:
    x_min, y_min, x_max, y_max = layout.bounds_m
    axes.set_aspect("equal")
    axes.set_xlim(x_min - _MARGIN_M, x_max + _MARGIN_M)
    axes.set_ylim(y_min - _MARGIN_M, y_max + _MARGIN_M)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MultipleLocator(4.0))
    axes.set_xlabel("x in m")
    axes.set_ylabel("y in m")
    axes.label_outer()
    axes.tick_params(length=3)
    for spine in axes.spines.values():
        spine.set_visible(False)


def _start_colours(layout: HallwayLayout) -> dict[str, str]:
    return {
        name: style.START_COLOURS[i % len(style.START_COLOURS)]
        for i, (name, _) in enumerate(layout.start_areas_m)
    }


def _label_area(axes: Axes, name: str, polygon: FloatArray, colour: str) -> None:
    x, y = (polygon.min(axis=0) + polygon.max(axis=0)) / 2
    axes.text(
        x,
        y,
        name,
        color=colour,
        fontsize=7.5,
        fontweight="bold",
        ha="center",
        va="center",
        zorder=10,
        parse_math=False,
        bbox={"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 1.0},
    )
