"""State visitation of the demonstrations (Fig. 5.7) with the recorded tracks on top."""

from collections.abc import Sequence

from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from report import style
from report.figures.map_axes import colour_bar, draw_areas, draw_cells, map_figure
from report.layout import HallwayLayout
from report.wording import counted
from serd_core.arrays import FloatArray, float_array
from serd_core.grid.grid import Grid


def draw_visitation(
    layout: HallwayLayout,
    grid: Grid,
    decisions_per_state: FloatArray,
    tracks_m: Sequence[FloatArray] = (),
) -> Figure:
    """Decisions taken per cell (S,) in shades of red, tracks (T, 2) as thin lines."""
    counts = float_array("decisions_per_state", decisions_per_state, (grid.n_states,))
    with style.report_style():
        figure, (axes,) = map_figure(layout, height_in=7.3, width_in=6.4)
        cells = draw_cells(axes, grid, counts, Normalize(0, max(counts.max(), 1)), style.VISITS_MAP)
        draw_areas(axes, layout, filled=False)
        for track in tracks_m:
            axes.plot(*track.T, color=style.INK, linewidth=0.7, alpha=0.55, zorder=4, gid="track")
        colour_bar(figure, axes, cells, "decisions taken in the cell")
        n_tracks = f", {counted(len(tracks_m), 'track')}" if len(tracks_m) else ""
        axes.set_title(f"{int(counts.sum())} decisions{n_tracks}")
    return figure
