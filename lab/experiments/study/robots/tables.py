"""The tables of the study of four robots."""

from collections.abc import Mapping
from itertools import product

import numpy as np
import pandas as pd

from lab.experiments.running.statistics import mean_interval, paired_family
from lab.experiments.running.tables import Row
from lab.experiments.study.products import load_part
from lab.experiments.study.robots.settings import TASKS, RobotsStudy

SERD = "serd"
BY = ["place", "task", "robot"]


def all_tables(study: RobotsStudy) -> Mapping[str, pd.DataFrame]:
    """Every table by the name of its file."""
    drives = pd.DataFrame(
        [row for part in study.settings.parts for row in load_part(study, "drives", *part)["rows"]]
    )
    learned = learned_of(study)
    return {
        "drives": drives,
        "learned": learned,
        "demonstrations": demonstrations_of(study),
        "summary": summary_of(study, drives),
        "paired": paired(study, drives),
        "forecasts": forecasts(drives, learned),
    }


def demonstrations_of(study: RobotsStudy) -> pd.DataFrame:
    """Decisions of each local model in the demonstrations, and their mean seconds."""
    return pd.DataFrame(
        {"place": place, "repetition": number}
        | load_part(study, "learning", place, number)["demonstrations"]
        for place, number in study.settings.parts
    )


def learned_of(study: RobotsStudy) -> pd.DataFrame:
    """What each robot of a model learned, and the quantiles of its predicted times."""
    rows: list[Row] = []
    for place, number in study.settings.parts:
        robots = load_part(study, "learning", place, number)["robots"]
        for name, robot in robots.items():
            if robot["learned"]:
                rows.append(
                    {"place": place, "repetition": number, "robot": name} | robot["learned"]
                )
    return pd.DataFrame(rows)


def summary_of(study: RobotsStudy, drives: pd.DataFrame) -> pd.DataFrame:
    """Means with intervals, medians and tails of the seconds, by place, task and robot."""
    rng = np.random.default_rng([study.settings.seed, 1])
    rows: list[Row] = []
    for place, chosen in drives.groupby(BY, sort=False):
        seconds = chosen["seconds"].to_numpy()
        row: Row = dict(zip(BY, map(str, place), strict=True)) | {"drives": len(chosen)}
        row |= mean_interval(seconds, study.settings.statistics, rng).columns("mean_s")
        row |= {"median_s": float(np.median(seconds)), "p90_s": float(np.quantile(seconds, 0.9))}
        row |= {"arrived": float(chosen["arrived"].mean())}
        rows.append(row | {"contacts": int(chosen["contacts"].sum())})
    return pd.DataFrame(rows)


def paired(study: RobotsStudy, drives: pd.DataFrame) -> pd.DataFrame:
    """Seconds of SERD less those of each other robot on the same seeds; ratio: theirs over SERD's.

    Intervals are of drives, and p-values by flipped signs with Holm's correction over the robots.
    """
    rng = np.random.default_rng([study.settings.seed, 2])
    rows: list[Row] = []
    for (place, task), chosen in drives.groupby(["place", "task"], sort=False):
        table = chosen.pivot(index=["repetition", "episode"], columns="robot", values="seconds")
        if len(table.columns) == 1:
            continue
        for row in paired_family(table, SERD, study.settings.statistics, rng):
            ratio = float(table[row["second"]].mean() / table[SERD].mean())
            rows.append({"place": place, "task": task} | row | {"ratio": ratio})
    return pd.DataFrame(rows)


def forecasts(drives: pd.DataFrame, learned: pd.DataFrame) -> pd.DataFrame:
    """Share of drives within the predicted 90 % band, and predicted and driven medians."""
    both = drives.merge(learned, on=["place", "repetition", "robot"])
    rows: list[Row] = []
    for place, task in product(both["place"].unique(), TASKS):
        for robot, own in both[both["place"] == place].groupby("robot", sort=False):
            chosen = own[own["task"] == task]
            low, middle, high = (
                chosen[f"{task} {share}"].astype(float).fillna(np.inf)
                for share in ("0.05", "0.5", "0.95")
            )
            within = (low <= chosen["seconds"]) & (chosen["seconds"] <= high)
            rows.append(
                {
                    "place": place,
                    "task": task,
                    "robot": robot,
                    "drives": len(chosen),
                    "within": float(within.mean()),
                    "predicted_median_s": float(middle.median()),
                    "median_s": float(chosen["seconds"].median()),
                }
            )
    return pd.DataFrame(rows)
