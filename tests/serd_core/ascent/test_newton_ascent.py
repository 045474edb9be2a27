import numpy as np
import pytest

from serd_core.ascent.ascent import Objective
from serd_core.ascent.trust_region import NewtonAscent

WEIGHTS, SHARES = np.array([1.0, 4.0, 9.0]), np.array([0.5, 0.3, 0.2])
TOP = np.log(SHARES)


class Poisson(Objective):
    """sum w (p x - exp x), whose maximum is log p; counts its Hessians."""

    def __init__(self):
        self.hessians = 0

    def evaluate(self, vector):
        value = WEIGHTS @ (SHARES * vector - np.exp(vector))
        return float(value), WEIGHTS * (SHARES - np.exp(vector))

    def hessian(self, vector):
        self.hessians += 1
        return -np.diag(WEIGHTS * np.exp(vector))


def test_a_hessian_is_kept_while_steps_shrink_and_the_maximum_has_its_own():
    objective = Poisson()
    found = NewtonAscent().maximise(objective, np.zeros(3))
    assert found.converged
    np.testing.assert_allclose(found.vector, TOP, atol=1e-7)
    assert objective.hessians < found.n_steps


@pytest.mark.parametrize("factor", [0.5, 1.0, 2.0])
def test_an_estimate_of_the_information_saves_hessians(factor):
    near, exact = Poisson(), np.diag(WEIGHTS * SHARES)
    found = NewtonAscent().maximise(near, TOP + 1e-3, information=factor * exact)
    assert found.converged
    np.testing.assert_allclose(found.vector, TOP, atol=1e-7)
    assert near.hessians <= 2


def test_a_wrong_estimate_of_the_information_is_replaced():
    objective = Poisson()
    found = NewtonAscent().maximise(objective, np.zeros(3), information=1e-6 * np.eye(3))
    assert found.converged
    np.testing.assert_allclose(found.vector, TOP, atol=1e-7)
    saddle = NewtonAscent().maximise(Poisson(), np.zeros(3), information=-np.eye(3))
    np.testing.assert_allclose(saddle.vector, TOP, atol=1e-7)
