import numpy as np
import pytest
from scipy.special import gammaincc
from scipy.stats import gamma

from serd_core.semi_markov.gamma_law import log_density, log_discount, log_survival

RATE = -np.log(0.97)


def differences(function, at, width=1e-4):
    steps = [function(at + k * width) for k in (-2, -1, 1, 2)]
    return (steps[0] - 8.0 * steps[1] + 8.0 * steps[2] - steps[3]) / (12.0 * width)


@pytest.fixture(scope="module")
def laws():
    rng = np.random.default_rng(1)
    log_mean, log_shape = rng.uniform(-2, 2, 400), rng.uniform(np.log(0.1), np.log(200.0), 400)
    return log_mean + rng.uniform(-2.5, 1.2, 400), log_mean, log_shape


def discount(_, mean, shape):
    return log_discount(mean, shape, RATE)


@pytest.mark.parametrize("law", [discount, log_density, log_survival])
def test_derivatives_are_those_of_differences(laws, law):
    dwell, mean, shape = laws
    found, size = law(dwell, mean, shape), 1.0 + np.exp(shape)
    size += np.abs(found.value)
    for of, by, slope in (
        ("value", (1.0, 0.0), found.mean),
        ("value", (0.0, 1.0), found.shape),
        ("mean", (1.0, 0.0), found.mean_mean),
        ("mean", (0.0, 1.0), found.mean_shape),
        ("shape", (1.0, 0.0), found.mean_shape),
        ("shape", (0.0, 1.0), found.shape_shape),
    ):

        def along(x, of=of, by=by):
            return getattr(law(dwell, mean + by[0] * x, shape + by[1] * x), of)

        np.testing.assert_array_less(np.abs(slope - differences(along, 0.0)) / size, 1e-8)


def test_density_and_survival_are_those_of_scipy(laws):
    dwell, mean, shape = laws
    a = np.exp(shape)
    expected = gamma.logpdf(np.exp(dwell), a, scale=np.exp(mean) / a)
    np.testing.assert_allclose(log_density(dwell, mean, shape).value, expected, rtol=1e-9)
    tail = gammaincc(a, a * np.exp(dwell - mean))
    seen = tail > 1e-250
    found = log_survival(dwell, mean, shape).value
    np.testing.assert_allclose(found[seen], np.log(tail[seen]), rtol=1e-9, atol=1e-11)


def test_discount_is_the_mean_of_powers_and_that_of_one_time_for_large_shapes():
    rng = np.random.default_rng(2)
    times = rng.gamma(2.0, 1.5, 400_000)
    found = np.exp(log_discount(np.log(3.0), np.log(2.0), RATE).value)
    assert found == pytest.approx(np.mean(0.97**times), abs=2e-4)
    exact = log_discount(np.log(3.0), np.log(1e14), RATE).value
    assert exact == pytest.approx(3.0 * np.log(0.97), rel=1e-12)
