"""Fig. 5.5: the features of section 5.1.3, for every state and action."""

import numpy as np
from matplotlib.figure import Figure

from experiments.running.repetitions import Row
from experiments.study.figures.context import FigureContext
from experiments.study.tables.results import Results
from report.figures.maps import draw_features
from serd_core.grid.grid import Action


def rows(results: Results) -> list[Row]:
    """One row per state and action that is available there."""
    problem = results.problem
    table: list[Row] = []
    for state, action in np.argwhere(problem.mdp.available):
        x_m, y_m = problem.grid.centers_m[state]
        values = problem.features[state, action]
        place = {"state": int(state), "x_m": float(x_m), "y_m": float(y_m)}
        named = dict(zip(problem.feature_names, map(float, values), strict=True))
        table.append(place | {"action": Action(action).name.lower()} | named)
    return table


def draw(table: list[Row], context: FigureContext) -> Figure:
    """One panel per feature, and per action where it matters."""
    problem = context.problem
    values = np.zeros_like(problem.features)
    available = np.zeros(values.shape[:2], dtype=np.bool_)
    for row in table:
        place = int(row["state"]), int(Action[str(row["action"]).upper()])
        values[place] = [float(row[name]) for name in problem.feature_names]
        available[place] = True
    # At the goal only waiting is left; what does not depend on the action is the same for all.
    for state in problem.goal_states:
        values[state] = values[state, Action.WAIT]
    return draw_features(context.layout, problem.grid, values, problem.feature_names, available)
