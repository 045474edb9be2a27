import numpy as np
import pytest

from lab.experiments.priors import (
    PRIORS,
    PriorsConfig,
    optimal_distributions,
)
from lab.experiments.running.tables import plain_rows


@pytest.fixture(scope="module")
def optima():
    rows = plain_rows(optimal_distributions(PriorsConfig(n_angles=720)))
    return {name: [row for row in rows if row["prior"] == name] for name in PRIORS}


def test_the_l1_norm_has_four_optima_two_of_which_give_the_same_distribution(optima):
    rows = optima["L1"]
    assert len(rows) == 4
    found = sorted(round(row["p_1"], 4) for row in rows)
    expected = 1 / (1 + np.exp(-1.0))
    np.testing.assert_allclose(found, [1 - expected, 1 - expected, expected, expected], atol=1e-4)


def test_the_l2_norm_prefers_no_point_of_the_circle(optima):
    assert [row["p_1"] for row in optima["L2"]] == [None]


def test_entropy_is_highest_on_the_line_of_equal_parameters(optima):
    rows = optima["Entropy"]
    assert len(rows) == 2
    for row in rows:
        assert row["theta_1"] == pytest.approx(row["theta_2"], abs=1e-3)
        assert row["p_1"] == pytest.approx(0.5, abs=1e-3)


def test_the_divergence_comes_as_close_to_its_reference_as_the_circle_allows(optima):
    (row,) = optima["KLD(Q||P)"]
    closest = 1 / (1 + np.exp(-np.sqrt(2)))
    assert row["p_1"] == pytest.approx(closest, abs=1e-6)
    assert closest < 0.9
