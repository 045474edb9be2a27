"""All tables of the people study."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import kstest

from lab.experiments.running.statistics import paired_family
from lab.experiments.running.tables import Row
from lab.experiments.study.people.learners import SERD
from lab.experiments.study.people.recordings import Run
from lab.experiments.study.people.settings import PeopleSettings
from lab.experiments.study.people.walkers import DISTANCE_OVER_SPEED

INTERVALS = (0.5, 0.9)
#: Decision period of which the moves that no neighbour represents are counted.
PERIOD_S = 0.8
PERIODS = "decision periods"


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
        away = (own["pit"] - 0.5).abs()
        covered = {
            f"coverage_{round(100 * share)}": (away <= share / 2).mean() for share in INTERVALS
        }
        covered["pit_distance"] = kstest(own["pit"], "uniform").statistic
        # A point has no interval.
        if method == DISTANCE_OVER_SPEED:
            covered = dict.fromkeys(covered)
        rows.append(
            {
                "method": method,
                "log_likelihood": _weighted(seen, "log_likelihood"),
                "dwell_log_likelihood": _weighted(seen, "dwell_log_likelihood"),
                "crps_s": own["crps_s"].mean(),
                "median_error_s": (own["median_s"] - own["arrival_s"]).abs().mean(),
                "bias_s": (own["median_s"] - own["arrival_s"]).mean(),
                **covered,
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
                "left_out": sum(run.left_out.values()),
                "reasons": "; ".join(f"{n} {reason}" for reason, n in run.left_out.items()),
                "width_m": round(run.width_m, 2),
                "length_m": run.n_columns * run.grid.cell_size_m,
                "rows": run.grid.walkable.shape[0],
                f"unrepresented_{PERIOD_S:g}_s": round(run.unrepresented(PERIOD_S), 4),
                "seconds": round(run.span_s[1] - run.span_s[0], 1),
                "assumed": "; ".join(run.assumed),
            }
            for run in runs
        ]
    )


def headline(tables: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """The main numbers of each method."""
    return tables["summary"][
        ["method", "log_likelihood", "crps_s", "coverage_50", "coverage_90", "pit_distance"]
    ]


def _weighted(rows: pd.DataFrame, measure: str) -> float | None:
    """Mean over all moves of all folds."""
    values = rows[measure].astype(float)
    if not len(rows) or values.isna().any():
        return None
    return float(np.average(values, weights=rows["n_moves"]))
