"""Tables of times of arrival: predicted against measured, and method against method."""

from collections.abc import Callable

import numpy as np
import pandas as pd

from experiments.running.statistics import paired_family
from experiments.running.tables import Row
from experiments.study.arrival.distances import ArrivalTables, distance_row
from experiments.study.fits.methods import BASELINE, OURS
from experiments.study.recordings.experts import EXPERTS, PEOPLE
from experiments.study.tables.results import Results
from serd_core.arrays import FloatArray

#: Scores of a method, (R,) each; the worlds of a repetition are the same for all methods.
_SCORES: dict[str, Callable[[ArrivalTables], FloatArray]] = {
    "crps_s": lambda tables: tables.scores,
    "measured_mean_s": lambda tables: tables.measured_means_s,
}


def arrival_distances(results: Results) -> pd.DataFrame:
    """Distances of predicted from measured times of arrival, for every expert and method."""
    rng = np.random.default_rng([results.settings.seed, 3])
    table: list[Row] = []
    for expert in EXPERTS:
        for method in results.methods(expert):
            tables = results.arrival_tables(expert, method)
            predictions = pd.DataFrame(results.predictions(expert, method))
            sampled = np.array(predictions["sampled_cdf"].tolist())
            table.append(
                {
                    "expert": expert,
                    "method": method,
                    **distance_row(tables, results.settings.statistics, rng),
                    "sampled_gap": float(np.abs(sampled - tables.predicted).max()),
                    "chain_ms": predictions["chain_ms"].median(),
                    "sampled_ms": predictions["sampled_ms"].median(),
                }
            )
    return pd.DataFrame(table)


def arrival_scores(results: Results) -> pd.DataFrame:
    """Differences of scores between methods, within repetitions.

    One family of tests: all other methods, for one measure.
    """
    rng = np.random.default_rng([results.settings.seed, 4])
    table: list[Row] = []
    for expert in EXPERTS:
        first = OURS if expert == PEOPLE else BASELINE
        tables = {name: results.arrival_tables(expert, name) for name in results.methods(expert)}
        for measure, values_of in _SCORES.items():
            values = pd.DataFrame({name: values_of(each) for name, each in tables.items()})
            place: Row = {"expert": expert, "measure": measure, "first": first}
            family = paired_family(values, first, results.settings.statistics, rng)
            table += [place | row for row in family]
    return pd.DataFrame(table)
