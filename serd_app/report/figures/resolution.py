"""Completed and far moves by cell size and decision period, with what is used and what is best."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from serd_app.demonstrations.grid.resolution import MOST_FAR, ResolutionAdvice, ResolutionRow
from serd_app.report import style
from serd_app.report.figures.map_axes import colour_bar
from serd_app.report.style import Look, new_figure
from serd_app.report.words import percent


def draw_resolution(advice: ResolutionAdvice) -> Figure:
    """Share of completed moves as shade and number, hatched where too many go farther."""
    cells = sorted({row.cell_size_m for row in advice.rows})
    periods = sorted({row.period_s for row in advice.rows})
    shares = np.full((len(cells), len(periods)), np.nan)
    for row in advice.rows:
        shares[cells.index(row.cell_size_m), periods.index(row.period_s)] = row.completed
    with style.report_style():
        figure = new_figure(1.9 + 0.55 * len(periods), 1.7 + 0.36 * len(cells))
        axes = figure.subplots()
        image = axes.imshow(
            shares, origin="lower", aspect="auto", cmap=style.VALUE_MAP, norm=Normalize(0, 1)
        )
        for row in advice.rows:
            place = periods.index(row.period_s), cells.index(row.cell_size_m)
            _draw_row(axes, row, place, best=row == advice.best)
        axes.set_xticks(range(len(periods)), [f"{each:g}" for each in periods])
        axes.set_yticks(range(len(cells)), [f"{each:g}" for each in cells])
        axes.set(xlabel="decision period in s", ylabel="side of a cell in m")
        axes.set_title("used: framed; fits best: dashed frame", loc="left", fontsize=8.5)
        colour_bar(figure, axes, image, "moves that end in a neighbouring cell")
        figure.supxlabel(f"hatched: more than {percent(MOST_FAR)} go farther", size=8)
    return figure


def _draw_row(axes: Axes, row: ResolutionRow, place: tuple[int, int], *, best: bool) -> None:
    x, y = place
    number = f"{100 * row.completed:.0f}"
    axes.text(x, y, number, ha="center", va="center", fontsize=7.5, color=style.INK)
    looks: tuple[tuple[int, Look], ...] = (
        (row.far > MOST_FAR, {"hatch": "///", "edgecolor": style.RED, "linewidth": 0}),
        (row.used, {"edgecolor": style.INK, "linewidth": 2.2, "zorder": 4}),
        (best, {"edgecolor": style.GREEN, "linestyle": "--", "linewidth": 2.2, "zorder": 4}),
    )
    for wanted, look in looks:
        if wanted:
            axes.add_patch(Rectangle((x - 0.5, y - 0.5), 1, 1, fill=False, **look))
