"""The direction people walk in per cell, as told from recorded people."""

import numpy as np
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from report import style
from report.figures.fitted_axes import fitted_figure
from report.figures.map_axes import colour_bar, draw_cells, map_figure
from report.figures.policy_map import draw_arrows
from report.layout import HallwayLayout
from serd_core.arrays import BoolArray, FloatArray, IntArray, float_array
from serd_core.grid.grid import Action, Grid
from serd_core.grid.navigation import NO_FLOW


def draw_flow_map(
    grid: Grid,
    flow: IntArray,
    order: FloatArray,
    *,
    layout: HallwayLayout | None = None,
    scenario_flow: IntArray | None = None,
) -> Figure:
    """flow (S,) as arrows (dot = none), order (S,) 0 to 1 in shades of blue.

    layout: plan of the place where one is known. scenario_flow: (S,) what the scenario says; arrows
    that say something else are red.
    """
    shades = float_array("order", order, (grid.n_states,))
    differing = np.zeros(grid.n_states, dtype=bool)
    if scenario_flow is not None:
        differing = (flow != scenario_flow) & (flow != NO_FLOW)
    with style.report_style():
        if layout is None:
            figure, axes = fitted_figure(grid)
        else:
            figure, (axes,) = map_figure(layout, height_in=7.3, width_in=6.4)
        cells = draw_cells(axes, grid, shades, Normalize(0, 1), style.VALUE_MAP)
        arrows = np.where(flow == NO_FLOW, int(Action.WAIT), flow)
        draw_arrows(axes, grid, arrows, np.zeros(grid.n_states, dtype=bool), differing)
        if layout is None:
            axes.autoscale_view()
        colour_bar(figure, axes, cells, "1: all walk the same way, 0: they cancel")
        axes.set_title(_title(flow, differing, compared=scenario_flow is not None))
    return figure


def _title(flow: IntArray, differing: BoolArray, *, compared: bool) -> str:
    n_known = int((flow != NO_FLOW).sum())
    known = f"flow known in {n_known} of {len(flow)} cells"
    return f"{known},\n{int(differing.sum())} not the scenario's (red)" if compared else known
