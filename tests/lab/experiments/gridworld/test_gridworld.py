import numpy as np
import pandas as pd
import pytest
from PIL import Image

from lab.experiments.gridworld.experiment import (
    GridworldConfig,
    measures,
    one_repetition,
    policy_of,
    scenes,
)
from lab.experiments.gridworld.learners import Estimate
from lab.experiments.gridworld.problem import true_dynamics
from lab.experiments.running.tables import quartiles, welch_test
from serd_core.bayes.draws import PosteriorDraws
from serd_core.policies.solved_policy import soft_policy

SMALL = GridworldConfig(side=8, sizes=(8,), n_steps=15, n_test_episodes=50, n_repetitions=3)


def changed(**settings):
    return SMALL.model_copy(update=settings)


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


@pytest.mark.parametrize("name", ["SERD, evidence", "SERD, averaged"])
def test_the_default_by_evidence_is_compared_too_and_predicts_better_than_irl(rows, name):
    assert median(rows, name, "log_likelihood") > median(rows, "MDCE IRL", "log_likelihood")


def test_the_policy_of_draws_is_the_mean_of_their_soft_policies():
    problem = scenes(SMALL)[0].world.problem
    weights, tables = np.array([[6.0, 6.0], [0.0, 2.0]]), np.stack([true_dynamics()] * 2)
    draws = PosteriorDraws(weights, weights, weights, tables, tables)
    averaged = Estimate(weights.mean(axis=0), true_dynamics(), None, converged=True, draws=draws)
    each = [soft_policy(problem, one, true_dynamics()).probabilities for one in weights]
    assert policy_of(problem, averaged) == pytest.approx((each[0] + each[1]) / 2.0, abs=1e-9)


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


def test_an_image_makes_the_environment(tmp_path):
    rng = np.random.default_rng(0)
    pixels = rng.integers(0, 255, (60, 60), dtype=np.uint8)
    pixels[30:] = 200  # smooth in the south
    Image.fromarray(pixels).save(tmp_path / "scene.png")
    training, transfer = scenes(changed(image=tmp_path / "scene.png"))
    forest = training.world.forest.reshape(8, 8)
    assert np.all(forest[5:])
    assert not np.any(forest[:3])
    assert 0 < transfer.world.forest.mean() < 1
