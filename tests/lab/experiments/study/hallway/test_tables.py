"""Tables over repetitions, on results whose every number is made up here."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from lab.experiments.running.tables import plain_rows
from lab.experiments.study.arrival.distances import ArrivalTables
from lab.experiments.study.fits.methods import BASELINE, OURS
from lab.experiments.study.hallway.tables import MEASURES, arrival_scores, beliefs
from lab.experiments.study.recordings.experts import EXPERTS, PEOPLE

N = 6
OTHER, ASSUMED = "MDCE IRL, likelihood", "tied"
BETTER_BY = 0.25


def made_up(settings):
    """Ours and the assumed are better by 0.25 in every repetition, and arrive two periods later.

    Rows come in no order that repetitions could be matched by.
    """
    better, steps = (OURS, ASSUMED), np.arange(21)
    methods = {name: [BASELINE, ASSUMED] for name in EXPERTS} | {PEOPLE: [OURS, OTHER]}
    measures = [
        {"expert": expert, "repetition": repetition, "size": size, "method": method}
        | dict.fromkeys(MEASURES, repetition + BETTER_BY * (method in better))
        for expert in EXPERTS
        for size in (2, 20)
        for method in methods[expert]
        for repetition in range(N)[:: 1 if method in better else -1]
    ]

    def arrival_tables(_, method):
        arrived, predicted = (
            np.tile(steps >= at, (N, 1)).astype(float)
            for at in (12 if method in better else 10, 11)
        )
        return ArrivalTables(predicted, arrived, 5, 2.0)

    return SimpleNamespace(
        settings=settings,
        methods=methods.get,
        measures=pd.DataFrame(measures),
        arrival_tables=arrival_tables,
    )


def test_beliefs_and_arrivals_are_compared_as_differences_to_irl(settings):
    results = made_up(settings)
    rows = beliefs(results).to_dict("records")
    assert {row["expert"] for row in rows} == set(EXPERTS) - {PEOPLE}
    for row in rows:
        baseline = row["assumption"] == BASELINE
        assert row["n"] == N
        assert row["mean"] == np.mean(range(N)) + (0.0 if baseline else BETTER_BY)
        assert row["difference"] == (0.0 if baseline else BETTER_BY)
        assert row["difference_lower"] <= row["difference"] <= row["difference_upper"]
        expected = np.nan if baseline else 2 / 2**N
        assert row["p_holm"] == pytest.approx(expected, nan_ok=True)
    found = {(row["expert"], row["measure"]): row for row in plain_rows(arrival_scores(results))}
    for expert in EXPERTS:
        sign = 1.0 if expert == PEOPLE else -1.0
        # Both predictions are off by one period; ours takes two periods longer.
        assert found[expert, "crps_s"]["mean_difference"] == 0.0
        assert found[expert, "measured_mean_s"]["mean_difference"] == sign * 4.0
        assert found[expert, "measured_mean_s"]["p_holm"] == pytest.approx(2 / 2**N)
