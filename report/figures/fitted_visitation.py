"""Decisions and tracks on a grid that was fitted to them, where no plan of the place is known."""

from collections.abc import Sequence

from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from report import style
from report.figures.fitted_axes import fitted_figure
from report.figures.map_axes import colour_bar, draw_cells
from report.wording import counted
from serd_core.arrays import FloatArray, float_array
from serd_core.grid.grid import Grid


def draw_fitted_visitation(
    grid: Grid, decisions_per_state: FloatArray, tracks_m: Sequence[FloatArray]
) -> Figure:
    """Decisions taken per cell (S,) in shades of red, tracks (T, 2) as lines from a dot."""
    counts = float_array("decisions_per_state", decisions_per_state, (grid.n_states,))
    with style.report_style():
        figure, axes = fitted_figure(grid)
        cells = draw_cells(axes, grid, counts, Normalize(0, max(counts.max(), 1)), style.VISITS_MAP)
        for track in tracks_m:
            axes.plot(*track.T, color=style.INK, linewidth=0.9, zorder=4, gid="track")
            axes.plot(*track[0], "o", color=style.INK, markersize=4, zorder=5, gid="track start")
        axes.autoscale_view()
        colour_bar(figure, axes, cells, "decisions taken in the cell")
        axes.set_title(f"{int(counts.sum())} decisions, {counted(len(tracks_m), 'track')}")
    return figure
