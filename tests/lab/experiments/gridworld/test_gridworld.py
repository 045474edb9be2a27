from functools import partial

import numpy as np
import pandas as pd
import pytest
from PIL import Image
from pydantic import ValidationError

from lab.experiments.gridworld.experiment import (
    GridworldConfig,
    measures,
    one_repetition,
    policy_divergence,
    policy_of,
    scenes,
)
from lab.experiments.gridworld.learners import Estimate
from lab.experiments.gridworld.problem import true_dynamics
from lab.experiments.running.experiment import Session
from lab.experiments.running.tables import quartiles, welch_test
from serd_core.bayes.draws import PosteriorDraws
from serd_core.policies.solved_policy import soft_policy
from serd_sim.episodes.execution import Execution

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
    draws = PosteriorDraws(weights, weights, tables, tables)
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


def test_learners_of_the_policy_matching_expert_run_too():
    config = changed(expert="pm", sizes=(2,), side=5, n_steps=8, n_test_episodes=5)
    found = {row["learner"] for row in one_repetition(config, 0)}
    assert found == {"PM SERD", "PM SERD, regularised", "MDCE IRL", "REIRL"}


def test_repetitions_are_independent_and_reproducible(tmp_path, rows):
    config = changed(n_repetitions=2)
    session = Session(tmp_path, Execution(n_jobs=1), lambda *_: None)
    table = session.repeat(partial(one_repetition, config), config.n_repetitions, config)
    table = table.to_dict("records")
    assert table == rows[: len(table)]
    assert table[0]["log_likelihood"] != table[4]["log_likelihood"]


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


def test_images_and_masks_make_the_environments(tmp_path):
    rng = np.random.default_rng(0)
    Image.fromarray(rng.integers(0, 255, (60, 60), dtype=np.uint8)).save(tmp_path / "scene.png")
    mask = np.zeros((60, 60), np.uint8)
    mask[:30] = 255
    Image.fromarray(mask).save(tmp_path / "mask.png")
    config = changed(image=tmp_path / "scene.png", forest_mask=tmp_path / "mask.png")
    training, transfer = scenes(config)
    forest = training.world.forest.reshape(8, 8)
    assert np.all(forest[4:])
    assert not np.any(forest[:4])
    assert 0 < transfer.world.forest.mean() < 1


def test_wrong_settings_are_refused_by_name():
    with pytest.raises(ValidationError, match=r"expert\n.*'mdce' or 'pm'"):
        GridworldConfig(expert="novice")
    with pytest.raises(ValidationError, match=r"side\n.* greater than or equal to 4"):
        GridworldConfig(side=2)


def test_a_policy_diverges_from_itself_by_nothing_and_without_bound_from_one_that_rules_it_out():
    sure, wrong = np.array([[1.0, 0.0], [1.0, 0.0]]), np.array([[0.5, 0.5], [0.0, 1.0]])
    assert policy_divergence(sure, sure, np.array([1.0, 3.0])) == 0.0
    assert policy_divergence(sure, wrong, np.array([2.0, 0.0])) == pytest.approx(np.log(2.0))
    assert policy_divergence(sure, wrong, np.array([1.0, 3.0])) == np.inf
