"""Fig. 5.5: the features of section 5.1.3, for every state and action."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from lab.experiments.study.hallway.tables.results import Results
from lab.experiments.study.study import Study
from serd_app.report.figures.maps import draw_features
from serd_core.grid.grid import Action


def rows(results: Results) -> pd.DataFrame:
    """One row per state and action that is available there."""
    problem = results.problem
    state, action = np.nonzero(problem.mdp.available)
    x_m, y_m = problem.grid.centers_m[state].T
    names = [Action(int(each)).name.lower() for each in action]
    place = pd.DataFrame({"state": state, "x_m": x_m, "y_m": y_m, "action": names})
    values = pd.DataFrame(problem.features[state, action], columns=problem.feature_names)
    return place.join(values)


def draw(table: pd.DataFrame, study: Study) -> Figure:
    """One panel per feature, and per action where it matters."""
    problem = study.problem
    values = np.zeros_like(problem.features)
    available = np.zeros(values.shape[:2], dtype=np.bool_)
    actions = [int(Action[name.upper()]) for name in table["action"]]
    values[table["state"], actions] = table[list(problem.feature_names)]
    available[table["state"], actions] = True
    # At the goal only waiting is left; what does not depend on the action is the same for all.
    for state in problem.goal_states:
        values[state] = values[state, Action.WAIT]
    return draw_features(study.scenario, problem.grid, values, problem.feature_names, available)
