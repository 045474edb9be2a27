import numpy as np
import pandas as pd
import pytest

from lab.experiments.gridworld.experiment import (
    GridworldConfig,
    measures,
    one_repetition,
    scenes,
)
from lab.experiments.gridworld.learners import Estimate
from lab.experiments.gridworld.problem import true_dynamics
from lab.experiments.running.tables import quartiles, welch_test

SMALL = GridworldConfig(side=8, sizes=(8,), n_steps=15, n_test_episodes=50, n_repetitions=3)


@pytest.fixture(scope="module")
def rows():
    return [row for number in range(4) for row in one_repetition(SMALL, number)]


def median(rows, learner, measure):
    return np.median([row[measure] for row in rows if row["learner"] == learner])


def test_serd_explains_new_demonstrations_better_than_irl(rows):
    """Fig. 4.12 (a) and (c) in small."""
    for other in ("MDCE IRL", "REIRL"):
        assert median(rows, "MDCE SERD", "log_likelihood") > median(rows, other, "log_likelihood")
        assert median(rows, "MDCE SERD", "policy_divergence") < median(
            rows, other, "policy_divergence"
        )
    for name in ("SERD, evidence", "SERD, averaged"):
        assert median(rows, name, "log_likelihood") > median(rows, "MDCE IRL", "log_likelihood")


def test_the_truth_has_no_divergence_and_the_best_likelihood(rows):
    training, transfer = scenes(SMALL)
    truth = Estimate(np.array(SMALL.weights), true_dynamics(), None, converged=True)
    best = measures(training, transfer, truth)
    assert best["dynamics_divergence"] == pytest.approx(0)
    assert best["policy_divergence"] == pytest.approx(0)
    assert best["log_likelihood"] > max(row["log_likelihood"] for row in rows)


def test_ground_truth_follows_section_4_6_2():
    table = true_dynamics()
    np.testing.assert_allclose(table.sum(axis=1), 1)
    np.testing.assert_allclose(table[1], [0, 0.8, 0.1, 0, 0.1])
    np.testing.assert_allclose(table[8], [0.175, 0.175, 0.175, 0.175, 0.3])
    np.testing.assert_allclose(table[0], [1, 0, 0, 0, 0])


def test_quartiles_and_welch_are_those_of_the_textbook(rows):
    table = quartiles(pd.DataFrame(rows), "log_likelihood", ["size", "learner"])
    serd = table[table["learner"] == "MDCE SERD"].iloc[0]
    values = [r["log_likelihood"] for r in rows if r["learner"] == "MDCE SERD"]
    assert serd["n"] == 4
    found = serd["lower"], serd["median"], serd["upper"]
    assert found == pytest.approx(tuple(np.quantile(values, [0.25, 0.5, 0.75])))
    (test,) = welch_test(pd.DataFrame(rows), "log_likelihood", "MDCE SERD", "MDCE IRL")
    assert test["mean_difference"] > 0
    assert 0 <= test["p_value"] <= 1
    (lonely,) = welch_test(pd.DataFrame(rows[:4]), "log_likelihood", "MDCE SERD", "MDCE IRL")
    assert lonely["p_value"] is None
