"""Decisions and tracks on a grid that was fitted to them, where no plan of the place is known."""

from collections.abc import Sequence

import numpy as np
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from report import style
from report.canvas import new_figure
from report.figures.map_axes import colour_bar, draw_cells
from report.wording import counted
from serd_core.arrays import FloatArray, float_array
from serd_core.grid import Grid

_LONGER_SIDE_IN, _SHORTEST_SIDE_IN = 5.5, 2.5
_ROOM_IN = 1.2


def draw_fitted_visitation(
    grid: Grid, decisions_per_state: FloatArray, tracks_m: Sequence[FloatArray]
) -> Figure:
    """Decisions taken per cell (S,) in shades of red, tracks (T, 2) as lines from a dot."""
    counts = float_array("decisions_per_state", decisions_per_state, (grid.n_states,))
    rows, columns = grid.walkable.shape
    width_in, height_in = np.maximum(
        np.array([columns, rows]) * _LONGER_SIDE_IN / max(columns, rows), _SHORTEST_SIDE_IN
    )
    with style.report_style():
        figure = new_figure(float(width_in) + _ROOM_IN, float(height_in) + _ROOM_IN)
        axes = figure.subplots()
        cells = draw_cells(axes, grid, counts, Normalize(0, max(counts.max(), 1)), style.VISITS_MAP)
        for track in tracks_m:
            axes.plot(*track.T, color=style.INK, linewidth=0.9, zorder=4, gid="track")
            axes.plot(*track[0], "o", color=style.INK, markersize=4, zorder=5, gid="track start")
        axes.set_aspect("equal")
        axes.autoscale_view()
        axes.set_xlabel("x in m")
        axes.set_ylabel("y in m")
        colour_bar(figure, axes, cells, "decisions taken in the cell")
        axes.set_title(f"{int(counts.sum())} decisions, {counted(len(tracks_m), 'track')}")
    return figure
