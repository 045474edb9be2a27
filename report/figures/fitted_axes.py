"""Axes in metres under figures of a grid that was fitted, where no plan of the place is known."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from report.canvas import new_figure
from serd_core.grid.grid import Grid

_LONGER_SIDE_IN, _SHORTEST_SIDE_IN = 5.5, 2.5
_ROOM_IN = 1.2


def fitted_figure(grid: Grid) -> tuple[Figure, Axes]:
    """A figure of the grid's proportions and its axes."""
    rows, columns = grid.walkable.shape
    width_in, height_in = np.maximum(
        np.array([columns, rows]) * _LONGER_SIDE_IN / max(columns, rows), _SHORTEST_SIDE_IN
    )
    figure = new_figure(float(width_in) + _ROOM_IN, float(height_in) + _ROOM_IN)
    axes = figure.subplots()
    axes.set_aspect("equal")
    axes.set_xlabel("x in m")
    axes.set_ylabel("y in m")
    return figure, axes
