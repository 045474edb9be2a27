import numpy as np
import pytest

from lab.experiments.gridworld.experiment import GridworldConfig, measures, one_repetition, scenes
from lab.experiments.gridworld.landscape import generated_landscape, landscape_of_image
from lab.experiments.gridworld.learners import Estimate
from lab.experiments.gridworld.problem import true_dynamics

SMALL = GridworldConfig(side=8, sizes=(8,), n_steps=15, n_test_episodes=50, n_repetitions=3)


@pytest.fixture(scope="module")
def rows():
    return [row for number in range(3) for row in one_repetition(SMALL, number)]


def median(rows, learner, measure):
    return np.median([row[measure] for row in rows if row["learner"] == learner])


def test_serd_explains_new_demonstrations_better_than_irl(rows):
    """Fig. 4.12 (a) and (c) in small."""
    likelihood, divergence = (
        {row["learner"]: median(rows, row["learner"], measure) for row in rows}
        for measure in ("log_likelihood", "policy_divergence")
    )
    for other in ("MDCE IRL", "REIRL"):
        assert likelihood["MDCE SERD"] > likelihood[other]
        assert divergence["MDCE SERD"] < divergence[other]
    for name in ("SERD, evidence", "SERD, averaged"):
        assert likelihood[name] > likelihood["MDCE IRL"]


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


def test_rough_cells_are_forest_and_rows_count_northwards():
    image = np.full((80, 80), 0.5)
    image[:40] += 0.2 * np.random.default_rng(0).choice([-1, 1], size=(40, 80))
    image[60:, :40] = 0.9
    landscape = landscape_of_image(image, 4)
    np.testing.assert_array_equal(landscape.forest[2:], True)
    np.testing.assert_array_equal(landscape.forest[:2], False)
    assert landscape.brightness[0, 0] == 1.0
    assert landscape.brightness.min() == 0.0


def test_generated_landscapes_have_both_terrains_and_a_bright_road():
    landscape = generated_landscape(20, np.random.default_rng(1))
    assert 0.2 < landscape.forest.mean() < 0.6
    assert np.all((landscape.brightness == 1.0).any(axis=0))
    again = generated_landscape(20, np.random.default_rng(1))
    np.testing.assert_array_equal(landscape.brightness, again.brightness)
