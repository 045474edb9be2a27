"""All tables of the detour study."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from lab.experiments.running.statistics import paired_family
from lab.experiments.running.tables import Row
from lab.experiments.study.detour.arrival import DRIVEN
from lab.experiments.study.detour.fits import COUNTED, EXPERT, SERD
from lab.experiments.study.detour.settings import DetourStudy
from lab.experiments.study.products import load_part
from lab.experiments.study.recordings.reference import reference_table

#: Numbers of moves against the flow that a set of demonstrations shows, by the name of the bin.
BINS = {"0": (0, 0), "1–5": (1, 5), "6–25": (6, 25), "more": (26, np.inf)}
BY = ["size", "reward", "method"]


def all_tables(study: DetourStudy) -> Mapping[str, pd.DataFrame]:
    """Every table by the name of its file."""
    measures, arrivals = _rows(study, "fits", "measures"), _rows(study, "arrival", "rows")
    arrivals["driven"] = arrivals["driven"].map(np.mean, na_action="ignore")
    both = measures.merge(arrivals, on=["repetition", *BY])
    decoys = pd.DataFrame([load_part(study, "decoy", *part) for part in study.settings.decoy.parts])
    return {
        "measures": both,
        "summary": summary_of(both, measured_names(study)),
        "paired": paired(study, both),
        "decoy": decoys,
        "decoy_summary": decoy_summary(decoys),
        "reference_dynamics": reference_table(study),
    }


def measured_names(study: DetourStudy) -> list[str]:
    """Columns of `measures` that are averaged."""
    divergences = [f"divergence_{name}" for name in study.problem.model_names]
    return ["against_moves", "transfer_log_likelihood", *divergences, "forward_against"]


def summary_of(both: pd.DataFrame, names: list[str]) -> pd.DataFrame:
    """Means over repetitions, and medians of the times of arrival in seconds.

    A time beyond the limit counts as longer than every other, and a median beyond it is empty.
    """
    times = ["predicted", "predicted_by_truth", "driven"]
    groups = both.groupby(BY, sort=False)
    table = groups[names].mean()
    table["converged"] = groups["converged"].mean()
    late = both[times].astype(float).where(both[times].notna(), np.inf)
    medians = late.groupby([both[name] for name in BY], sort=False).median()
    return table.join(medians.replace(np.inf, np.nan)).reset_index()


def paired(study: DetourStudy, both: pd.DataFrame) -> pd.DataFrame:
    """SERD minus each other method within repetitions; p by Holm over the methods."""
    rng = np.random.default_rng([study.settings.seed, 1])
    rows: list[Row] = []
    for measure in ("transfer_log_likelihood", "divergence_against_flow", "driven"):
        for (size, reward), chosen in both.groupby(["size", "reward"], sort=False):
            if measure == "driven" and reward != DRIVEN:
                continue
            values = chosen.pivot(index="repetition", columns="method", values=measure)
            place: Row = {"measure": measure, "size": size, "reward": reward, "first": SERD}
            family = paired_family(values, SERD, study.settings.statistics, rng)
            rows += [place | row for row in family]
    return pd.DataFrame(rows)


def decoy_summary(decoys: pd.DataFrame) -> pd.DataFrame:
    """Per truth and number of moves seen: medians of the posterior, and coverage."""
    rows: list[Row] = []
    good = decoys[decoys["converged"]]
    for truth, by_truth in good.groupby("truth"):
        for name, (fewest, most) in BINS.items():
            chosen = by_truth[by_truth["moves"].between(fewest, most)]
            if chosen.empty:
                continue
            holds = (chosen["lower"] <= truth) & (truth <= chosen["upper"])
            middle = chosen[["lower", "median", "upper", "from_choices"]].median()
            place: Row = {"truth": truth, "moves": name, "n": len(chosen)}
            rows.append(place | middle.to_dict() | {"coverage": float(holds.mean())})
    return pd.DataFrame(rows)


def headline(tables: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """The main numbers of SERD and its baseline where the reward has no norm."""
    table = tables["summary"]
    chosen = table[(table["reward"] == DRIVEN) & table["method"].isin([SERD, COUNTED])]
    return chosen[
        [
            "size",
            "method",
            "transfer_log_likelihood",
            "divergence_against_flow",
            "forward_against",
            "predicted",
            "driven",
        ]
    ]


def _rows(study: DetourStudy, stage: str, name: str) -> pd.DataFrame:
    parts = study.settings.repetitions_of([EXPERT])
    return pd.DataFrame([row for part in parts for row in load_part(study, stage, *part)[name]])
