"""Fig. 5.11: greedy policies with the states from which they never arrive.

Two examples of each method: repetition 0, and of the others the one with the most trap states.
"""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from lab.experiments.study.hallway.tables.results import Results
from lab.experiments.study.recordings.experts import PEOPLE
from lab.experiments.study.study import Study
from serd_app.report import style
from serd_app.report.figures.map_axes import (
    OUTLINE_DASHES,
    area_legend,
    colour_bar,
    draw_areas,
    draw_cells,
    map_figure,
    outline_traps,
)
from serd_app.report.figures.maps import draw_arrows
from serd_bag.quantities import counted
from serd_core.arrays import BoolArray, IntArray
from serd_core.arrival.trap_states import trap_states


def rows(results: Results) -> pd.DataFrame:
    """Action and trap of every state for every method and repetition."""
    grid = results.problem.grid
    tables = []
    for method in results.methods(PEOPLE):
        for repetition, greedy in enumerate(results.models(PEOPLE, method, "greedy")):
            trapped = trap_states(grid.neighbours, greedy, results.problem.goal_states)
            columns = {
                "method": method,
                "repetition": repetition,
                "state": np.arange(grid.n_states),
                "action": greedy,
                "trapped": trapped,
            }
            tables.append(pd.DataFrame(columns))
    return pd.concat(tables)


def draw(table: pd.DataFrame, study: Study) -> Figure:
    """Upper row: repetition 0; lower row: of the others the one with the most traps.

    Shades are the share of repetitions in which a state is a trap.
    """
    grid = study.problem.grid
    methods = list(table["method"].unique())
    found = {method: _policies(table[table["method"] == method]) for method in methods}
    with style.report_style():
        figure, axes = map_figure(study.scenario, 2 * len(methods), height_in=9.4, width_in=13.5)
        for place, panel in enumerate(axes):
            method = methods[place % len(methods)]
            greedy, trapped = found[method]
            counts = trapped.sum(axis=1)
            number = 0 if place < len(methods) else 1 + int(counts[1:].argmax())
            cells = draw_cells(panel, grid, trapped.mean(axis=0), Normalize(0, 1), style.VALUE_MAP)
            _panel(panel, study, greedy[number], trapped[number])
            panel.set_title(
                f"{method}\nrepetition {number}: {counted(int(counts[number]), 'trap')}", fontsize=8
            )
        label = "share of repetitions in which the cell is a trap"
        trap = Line2D(
            [], [], color=style.RED, linestyle=OUTLINE_DASHES, label="traps, with arrows in red"
        )
        area_legend(figure, axes[0], [trap])
        colour_bar(figure, axes, cells, label, shrink=0.6, pad=0.01, aspect=30)
    return figure


def _panel(axes: Axes, study: Study, greedy: IntArray, trapped: BoolArray) -> None:
    grid = study.problem.grid
    is_goal = np.isin(np.arange(grid.n_states), study.problem.goal_states)
    draw_areas(axes, study.scenario, filled=False)
    draw_arrows(axes, grid, greedy, is_goal, trapped, width_in=0.012)
    outline_traps(axes, grid, trapped)


def _policies(table: pd.DataFrame) -> tuple[IntArray, BoolArray]:
    """(R, S) actions and traps of one method."""
    wide = table.pivot(index="repetition", columns="state")
    return wide["action"].to_numpy(), wide["trapped"].to_numpy()
