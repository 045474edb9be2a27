"""Fig. 5.7: visited cells of the demonstrations of repetition 0, set by set."""

import numpy as np
import pandas as pd
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from lab.experiments.study.fits.fitting import trials
from lab.experiments.study.hallway.tables.results import Results
from lab.experiments.study.recordings.demonstrations import load_sets
from lab.experiments.study.recordings.experts import PEOPLE
from lab.experiments.study.study import Study
from serd_app.report import style
from serd_app.report.figures.map_axes import colour_bar_below, draw_areas, draw_cells, map_figure
from serd_core.demonstrations.decisions import state_counts

SETS = ("training", "validation", "test", "transfer")


def rows(results: Results) -> pd.DataFrame:
    """Decisions per state of each set; the largest size is split."""
    problem, sizes = results.problem, results.settings.learning.sizes
    sets = load_sets(results, PEOPLE, 0)
    no_matter = np.full((problem.outcome_models.n_models, problem.outcome_models.n_outcomes), 0.2)
    *_, last = trials(results, sets.training, sizes, no_matter, 0)
    chosen = (last.training, last.validation, sets.test, sets.transfer)
    tables = []
    for name, decisions in zip(SETS, chosen, strict=True):
        counts = state_counts(decisions, problem.grid.n_states)
        state = np.flatnonzero(counts)
        columns = {
            "set": name,
            "episodes": len(decisions.episodes),
            "state": state,
            "x_m": problem.grid.centers_m[state, 0],
            "y_m": problem.grid.centers_m[state, 1],
            "decisions": counts[state].astype(np.int64),
        }
        tables.append(pd.DataFrame(columns))
    return pd.concat(tables)


def draw(table: pd.DataFrame, study: Study) -> Figure:
    """Four maps; shades are decisions per episode, so that sets of any size compare."""
    grid = study.problem.grid
    shares, episodes = {}, {}
    for name, chosen in table.groupby("set", sort=False):
        shares[name] = np.zeros(grid.n_states)
        shares[name][chosen["state"]] = chosen["decisions"] / chosen["episodes"]
        episodes[name] = chosen["episodes"].iloc[0]
    norm = Normalize(0, max(float(np.quantile(each, 0.995)) for each in shares.values()))
    with style.report_style():
        figure, axes = map_figure(study.scenario, len(SETS), height_in=5.4, width_in=12.5)
        for panel, (name, values) in zip(axes, shares.items(), strict=True):
            cells = draw_cells(panel, grid, values, norm, style.VISITS_MAP)
            draw_areas(panel, study.scenario, filled=False)
            panel.set_title(f"{name} ({episodes[name]})")
        colour_bar_below(
            figure, axes, cells, "decisions taken in the cell, per episode", extend="max"
        )
    return figure
