"""The reward features on the map (Fig. 5.5), one panel per action where the action matters."""

import numpy as np
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from report import style
from report.figures.map_axes import draw_cells, map_figure
from report.layout import HallwayLayout
from report.wording import in_words
from serd_core.arrays import BoolArray, FloatArray, float_array
from serd_core.grid.grid import Action, Grid


def draw_features(
    layout: HallwayLayout,
    grid: Grid,
    features: FloatArray,
    feature_names: tuple[str, ...],
    available: BoolArray,
) -> Figure:
    """features (S, A, F); available (S, A): a cell without the action stays empty."""
    table = float_array("features", features, (grid.n_states, len(Action), len(feature_names)))
    panels = [
        panel
        for i, name in enumerate(feature_names)
        for panel in _panels(name, table[:, :, i], np.asarray(available))
    ]
    with style.report_style():
        figure, axes = map_figure(layout, len(panels), height_in=4.8, width_in=12.0)
        for each, (title, values) in zip(axes, panels, strict=True):
            cells = draw_cells(each, grid, values, Normalize(-1, 1), style.FEATURE_MAP)
            each.set_title(title, fontsize=8)
        bar = figure.colorbar(cells, ax=axes, shrink=0.8, pad=0.01, aspect=25)
        bar.set_label("feature value")
        bar.outline.set_visible(False)
    return figure


def _panels(name: str, values: FloatArray, available: BoolArray) -> list[tuple[str, FloatArray]]:
    if (values == values[:, :1]).all():
        return [(f"{in_words(name)}\nany action", values[:, 0])]
    masked = np.where(available, values, np.nan)
    return [(f"{in_words(name)}\n{action.name.lower()}", masked[:, action]) for action in Action]
