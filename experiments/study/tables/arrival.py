"""Tables of times of arrival: predicted against measured, and method against method."""

from collections.abc import Callable

import numpy as np

from experiments.running.repetitions import Row
from experiments.study.arrival.distances import ArrivalTables, distance_row
from experiments.study.fits.methods import BASELINE, OURS
from experiments.study.recordings.experts import EXPERTS, PEOPLE
from experiments.study.tables.paired_statistics import paired_family
from experiments.study.tables.results import Results
from serd_core.arrays import FloatArray

#: What methods are compared by, (R,) each; the worlds of a repetition are the same for all of them.
_SCORES: dict[str, Callable[[ArrivalTables], FloatArray]] = {
    "crps_s": lambda tables: tables.scores,
    "measured_mean_s": lambda tables: tables.measured_means_s,
}


def arrival_distances(results: Results) -> list[Row]:
    """Predicted against measured times of arrival of every expert and method."""
    rng = np.random.default_rng([results.settings.seed, 3])
    table: list[Row] = []
    for expert in EXPERTS:
        for method in results.methods(expert):
            tables = results.arrival_tables(expert, method)
            costs = results.predictions(expert, method)
            row: Row = {"expert": expert, "method": method}
            row |= distance_row(tables, results.settings.statistics, rng)
            sampled = np.array([each["sampled_cdf"] for each in costs])
            table.append(
                row
                | {
                    "sampled_gap": float(np.abs(sampled - tables.predicted).max()),
                    "chain_ms": float(np.median([each["chain_ms"] for each in costs])),
                    "sampled_ms": float(np.median([each["sampled_ms"] for each in costs])),
                }
            )
    return table


def arrival_scores(results: Results) -> list[Row]:
    """Is one method's prediction better, its robot faster? Differences within repetitions.

    One family of tests: all other methods, for one measure.
    """
    rng = np.random.default_rng([results.settings.seed, 4])
    table: list[Row] = []
    for expert in EXPERTS:
        first = OURS if expert == PEOPLE else BASELINE
        for measure, values_of in _SCORES.items():
            values = {
                method: values_of(results.arrival_tables(expert, method)).tolist()
                for method in results.methods(expert)
            }
            ours = values.pop(first)
            place: Row = {"expert": expert, "measure": measure, "first": first}
            family = paired_family(ours, values, results.settings.statistics, rng)
            table += [place | row for row in family]
    return table
