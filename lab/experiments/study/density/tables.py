"""Tables of the density study: likelihood of held-out demonstrations, and times of arrival."""

from collections.abc import Iterable, Mapping

import numpy as np
import pandas as pd

from lab.experiments.running.statistics import mean_interval, paired_p_value
from lab.experiments.running.tables import Row
from lab.experiments.study.arrival.distances import ArrivalTables, distance_row
from lab.experiments.study.density.settings import DensityStudy
from lab.experiments.study.density.stages import WITH, WITHOUT, recorded
from lab.experiments.study.products import load_part
from serd_app.demonstrations.measured_density import joined_density
from serd_app.navigation.predicted_density import predicted_density

METHODS = (WITHOUT, WITH)
LIKELIHOODS = ("action_log_likelihood", "move_log_likelihood")


def all_tables(study: DensityStudy) -> Mapping[str, pd.DataFrame]:
    """Every table by the name of its file."""
    scores = pd.DataFrame(_scores(study))
    return {
        "scores": scores,
        "likelihood": pd.DataFrame(_likelihood(study, scores)),
        "arrival": pd.DataFrame(_arrival(study)),
        "crowds": pd.DataFrame(_crowds(study)),
    }


def headline(tables: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """What is printed."""
    shown = ["learned_from", "crowd", "method", "ks", "crps_s", "predicted_median_s"]
    return tables["arrival"][[*shown, "measured_median_s", "p_value"]]


def _scores(study: DensityStudy) -> Iterable[Row]:
    for people in study.settings.learned_from:
        for repetition in range(study.settings.repetitions):
            for row in load_part(study, "fits", people, repetition)["scores"]:
                yield {"learned_from": people, "repetition": repetition, **row}


def _likelihood(study: DensityStudy, scores: pd.DataFrame) -> Iterable[Row]:
    """Means per decision, and the difference of density within repetitions."""
    rng = np.random.default_rng(study.settings.seed)
    for (people, crowd), rows in scores.groupby(["learned_from", "crowd"]):
        for name in LIKELIHOODS:
            table = rows.pivot(index="repetition", columns="method", values=name)
            gain = (table[WITH] - table[WITHOUT]).to_numpy()
            found = mean_interval(gain, study.settings.statistics, rng)
            yield {
                "learned_from": people,
                "crowd": crowd,
                "measure": name,
                WITHOUT: table[WITHOUT].mean(),
                WITH: table[WITH].mean(),
                **found.columns("difference"),
                "p_value": paired_p_value(table[WITH], table[WITHOUT], rng),
            }


def _arrival(study: DensityStudy) -> Iterable[Row]:
    """Distances of `lab.experiments.study.arrival.distances`; p_value: of equal mean CRPS."""
    settings, rng = study.settings, np.random.default_rng(study.settings.seed)
    for people in settings.learned_from:
        for crowd in settings.predicted:
            tables = {name: arrival_tables(study, people, crowd, name) for name in METHODS}
            p_value = paired_p_value(tables[WITH].scores, tables[WITHOUT].scores, rng)
            for name, each in tables.items():
                row = distance_row(each, settings.statistics, rng)
                place: Row = {"learned_from": people, "crowd": crowd, "method": name}
                yield place | row | {"p_value": p_value}


def arrival_tables(study: DensityStudy, people: int, crowd: int, method: str) -> ArrivalTables:
    """Predicted and measured CDFs of each repetition, by whole periods."""
    period_s = study.scenario(crowd).decision_period_s
    predicted, measured = [], []
    for repetition in range(study.settings.repetitions):
        cdf = load_part(study, "fits", people, repetition)["predicted"][str(crowd)][method]
        times_s = np.array(load_part(study, "arrival", people, repetition)[str(crowd)])
        periods = np.ceil(times_s / period_s - 1e-9)
        predicted.append(cdf)
        measured.append((periods[:, None] <= np.arange(len(cdf))).mean(axis=0))
    return ArrivalTables(
        np.array(predicted), np.array(measured), study.settings.drives, float(period_s)
    )


def _crowds(study: DensityStudy) -> Iterable[Row]:
    """Predicted density of cells against the mean at all recorded decisions.

    fault_share: diagonal and far moves among them. aimed_at_pm2: mean of the cells aimed at.
    """
    for people in study.settings.crowds:
        repetitions = range(study.settings.repetitions)
        parts = [recorded(study, people, each)[1] for each in repetitions]
        contents = [load_part(study, "recordings", people, each) for each in repetitions]
        found = joined_density(parts)
        n_decisions, measured = len(found.aimed_at_pm2), found.mean_pm2
        predicted = predicted_density(study.scenario(people), study.problem.grid)
        yield {
            "crowd": people,
            "n_decisions": n_decisions,
            "fault_share": sum(c["n_diagonal"] + c["n_far"] for c in contents) / n_decisions,
            "predicted_pm2": predicted.mean(),
            "measured_pm2": measured.mean(),
            "correlation": float(np.corrcoef(predicted, measured)[0, 1]),
            "rms_difference_pm2": float(np.sqrt(np.mean((predicted - measured) ** 2))),
            "aimed_at_pm2": float(np.nanmean(found.aimed_at_pm2)),
        }
