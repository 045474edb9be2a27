import numpy as np
import pytest
from scipy.stats import gamma, kstest

from serd_core.arrival.dwell_times import (
    DwellModel,
    Pace,
    fit_dwell_times,
    paced_law,
)
from serd_core.arrival.law import ArrivalLaw
from serd_core.errors import SerdError

BETA, PHI, PACE = np.array([-0.3, 0.15]), np.array([0.04, 0.4]), 0.2


def moves(n_people, n_moves, seed=0):
    rng = np.random.default_rng(seed)
    person = np.repeat(np.arange(n_people), n_moves)
    pace = rng.normal(0, PACE, n_people)
    design = np.stack([np.ones(len(person)), rng.normal(size=len(person))], axis=1)
    kind = rng.integers(0, 2, len(person))
    mean = np.exp(design @ BETA + pace[person])
    return mean * rng.gamma(1 / PHI[kind], PHI[kind]), design, kind, person, pace


def test_the_fit_recovers_covariates_variation_and_pace():
    times, design, kind, person, _ = moves(600, 12)
    found = fit_dwell_times(times, design, kind, person)
    assert found.converged
    np.testing.assert_allclose(found.coefficients, BETA, atol=0.03)
    np.testing.assert_allclose(found.dispersion, PHI, rtol=0.08)
    assert np.sqrt(found.pace_variance) == pytest.approx(PACE, rel=0.08)


def test_the_posterior_of_a_pace_is_calibrated():
    times, design, kind, person, pace = moves(500, 6, seed=3)
    model = DwellModel(BETA, PHI, PACE**2)
    each = [
        model.pace(times[person == i], design[person == i], kind[person == i]) for i in range(500)
    ]
    scores = [(b - one.mean) / np.sqrt(one.variance) for b, one in zip(pace, each, strict=True)]
    assert kstest(scores, "norm").pvalue > 0.01
    assert np.mean([one.variance for one in each]) < PACE**2 / 2


def test_without_moves_the_pace_is_that_of_everyone():
    found = DwellModel(BETA, PHI, PACE**2).pace(np.zeros(0), np.zeros((0, 2)), np.zeros(0, int))
    assert found.mean == 0.0
    assert found.variance == pytest.approx(PACE**2)


def test_the_density_at_a_certain_pace_is_the_gamma_density():
    model = DwellModel(BETA, PHI, PACE**2)
    found = model.log_density(0.7, 0.9, 1, Pace(0.1, 1e-12))
    scale = 0.9 * np.exp(0.1) * PHI[1]
    assert found == pytest.approx(gamma(1 / PHI[1], scale=scale).logpdf(0.7), abs=1e-5)


def test_masses_have_the_mean_of_the_times():
    mass = DwellModel(BETA, PHI, PACE**2).mass(np.array([0.8, 0.4]), np.array([0, 1]), 0.05, 200)
    np.testing.assert_allclose(mass.sum(axis=1), 1.0, atol=1e-9)
    np.testing.assert_allclose(mass @ (np.arange(201) * 0.05), [0.8, 0.4], atol=2e-3)


def test_a_pace_multiplies_the_time_of_arrival():
    times = np.arange(1, 2001) * 0.01
    law = ArrivalLaw(times, gamma(20, scale=0.2).cdf(times), 1.0)
    slower = paced_law(law, Pace(np.log(1.5), 1e-10))
    np.testing.assert_allclose(slower.cdf, gamma(20, scale=0.3).cdf(times), atol=1e-3)
    uncertain = paced_law(law, Pace(0.0, 0.09))
    spread = [each.quantile_s(0.95) - each.quantile_s(0.05) for each in (law, uncertain)]
    assert spread[1] > 1.2 * spread[0]


def test_people_of_one_pace_are_fitted_with_next_to_none_of_its_own():
    """Expectation maximisation is slow where a variance goes to 0."""
    rng = np.random.default_rng(0)
    person = np.repeat(np.arange(40), 30)
    fit = fit_dwell_times(
        rng.gamma(2.0, 0.5, len(person)), np.ones((len(person), 1)), 0 * person, person
    )
    assert fit.converged
    assert fit.pace_variance < 1e-3
    assert fit.dispersion[0] == pytest.approx(0.5, abs=0.06)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"dwell_s": [1.0, 0.0]}, r"dwell_s must hold times above 0, got 0\.0 in row 1"),
        ({"kind": [-1, 0]}, r"kind\[0\] must be from 0 to n_kinds - 1 = 1, got -1"),
        ({"kind": [0, 2]}, r"kind\[1\] must be from 0 to n_kinds - 1 = 1, got 2"),
    ],
)
def test_wrong_moves_are_rejected(change, sentence):
    given = {"dwell_s": [1.0, 2.0], "kind": [0, 1]} | change
    with pytest.raises(SerdError, match=sentence):
        fit_dwell_times(np.array(given["dwell_s"]), np.ones((2, 1)), given["kind"], [0, 1], 2)
