import numpy as np
import pytest
from pydantic import ValidationError

from lab.experiments.priors import (
    PRIORS,
    PriorsConfig,
    log_prior,
    optimal_distributions,
    prior_surfaces,
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


def test_surfaces_hold_the_log_prior_by_second_and_first_parameter():
    surfaces = prior_surfaces(PriorsConfig(extent=1.0, n_points=5))
    for name, surface in surfaces.items():
        assert surface.value.shape == (5, 5)
        assert surface.value[4, 0] == log_prior(PRIORS[name], -1.0, 1.0)
    assert surfaces["KLD(Q||P)"].value[0, 4] > surfaces["KLD(Q||P)"].value[4, 0]


def test_too_coarse_a_circle_is_refused():
    with pytest.raises(ValidationError, match=r"n_angles\n.* greater than or equal to 8"):
        PriorsConfig(n_angles=3)
