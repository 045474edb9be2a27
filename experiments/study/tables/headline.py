"""The main numbers of a finished study, one row per method."""

from collections.abc import Mapping, Sequence

from experiments.running.repetitions import Row
from experiments.running.summary import quantile
from experiments.study.recordings.experts import PEOPLE
from experiments.study.tables.catalogue import MEASURES


def headline(tables: Mapping[str, Sequence[Row]]) -> list[Row]:
    """Medians at the largest number of demonstrations, and arrivals, of every method.

    test, transfer: log-likelihood per decision; KLD: of the dynamics from the reference; arrived,
    predicted: measured and predicted share; mean_s, predicted_s: mean times, cut off at the limit.
    """
    measures = [row for row in tables["measures"] if row["expert"] == PEOPLE]
    largest = max(row["size"] for row in measures)
    rows: list[Row] = []
    for arrival in tables["arrival_distances"]:
        if arrival["expert"] != PEOPLE:
            continue
        chosen = [
            row for row in measures if (row["method"], row["size"]) == (arrival["method"], largest)
        ]
        test, transfer, divergence = (
            quantile([row[name] for row in chosen], 0.5) for name in MEASURES
        )
        rows.append(
            {
                "method": arrival["method"],
                "test": test,
                "transfer": transfer,
                "KLD": divergence,
                "arrived": arrival["measured_arrival"],
                "predicted": arrival["predicted_arrival"],
                "mean_s": arrival["measured_mean_s"],
                "predicted_s": arrival["predicted_mean_s"],
                "KS": arrival["ks"],
            }
        )
    return rows
