"""All tables of the people study."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from lab.experiments.running.statistics import paired_family
from lab.experiments.running.tables import Row
from lab.experiments.study.people.fold import INTERVALS
from lab.experiments.study.people.learners import SERD
from lab.experiments.study.people.recordings import Run
from lab.experiments.study.people.settings import PeopleSettings


def all_tables(
    folds: Sequence[Mapping[str, Any]], runs: Sequence[Run], settings: PeopleSettings
) -> Mapping[str, pd.DataFrame]:
    """Every table by the name of its file."""
    moves = pd.DataFrame([row for fold in folds for row in fold["moves"]])
    arrivals = pd.DataFrame([row for fold in folds for row in fold["arrivals"]])
    fits = pd.json_normalize([row for fold in folds for row in fold["fits"]])
    return {
        "summary": summary_of(moves, arrivals),
        "paired": paired(moves, arrivals, settings),
        "moves": moves,
        "arrivals": arrivals,
        "fits": fits,
        "recordings": recordings_table(runs),
    }


def summary_of(moves: pd.DataFrame, arrivals: pd.DataFrame) -> pd.DataFrame:
    """A row per method, over all moves and people that were held out."""
    rows: list[Row] = []
    for method, own in arrivals.groupby("method", sort=False):
        seen = moves[moves["method"] == method]
        late_s = own["median_s"].astype(float) - own["arrival_s"]
        likelihood = None
        if len(seen):
            likelihood = float(np.average(seen["log_likelihood"], weights=seen["n_moves"]))
        names = [f"{round(100 * share)}" for share in INTERVALS]
        rows.append(
            {
                "method": method,
                "log_likelihood": likelihood,
                "crps_s": own["crps_s"].mean(),
                "median_error_s": late_s.abs().mean(),
                "bias_s": late_s.mean(),
                **{f"coverage_{name}": own[f"in_{name}"].mean() for name in names},
                "people": len(own),
                "without_median": int(own["median_s"].isna().sum()),
            }
        )
    return pd.DataFrame(rows)


def paired(moves: pd.DataFrame, arrivals: pd.DataFrame, settings: PeopleSettings) -> pd.DataFrame:
    """SERD minus each other method within folds; p by Holm."""
    rng = np.random.default_rng([settings.seed, 1])
    by_fold = {
        "log_likelihood": moves.pivot(index="fold", columns="method", values="log_likelihood"),
        "crps_s": arrivals.groupby(["fold", "method"])["crps_s"].mean().unstack(),
    }
    return pd.DataFrame(
        [
            {"measure": measure, "first": SERD} | row
            for measure, values in by_fold.items()
            for row in paired_family(values, SERD, settings.statistics, rng)
        ]
    )


def recordings_table(runs: Sequence[Run]) -> pd.DataFrame:
    """What was read, and what of it was left out or assumed."""
    return pd.DataFrame(
        [
            {
                "recording": run.name,
                "people": len(run.walkers),
                "decisions": len(run.decisions),
                "stayed": int(np.sum(run.decisions.next_state == run.decisions.state)),
                "left_out": sum(run.left_out.values()),
                "reasons": "; ".join(f"{n} {reason}" for reason, n in run.left_out.items()),
                "width_m": round(run.width_m, 2),
                "length_m": run.n_columns * run.grid.cell_size_m,
                "rows": run.grid.walkable.shape[0],
                "seconds": round(run.span_s[1] - run.span_s[0], 1),
                "assumed": "; ".join(run.assumed),
            }
            for run in runs
        ]
    )


def headline(tables: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """The main numbers of each method."""
    return tables["summary"][["method", "log_likelihood", "crps_s", "coverage_50", "coverage_90"]]
