"""Ascent over kinks: maxima where no gradient vanishes are found and certified."""

import numpy as np
import pytest
import scipy.optimize

from serd_core.ascent.ascent import AT_A_KINK, STOPPED, FunctionObjective
from serd_core.ascent.kinked import (
    STALLED,
    KinkedAscent,
)
from serd_core.ascent.trust_region import TrustRegion


def rosenbrock_with_a_kink(vector):
    """Lewis and Overton's example, upside down: its maximum (1, 1) lies on the curved kink."""
    x, y = vector
    bend = x**2 - y
    value = -8.0 * abs(bend) - (1.0 - x) ** 2
    side = 8.0 * (1.0 if bend >= 0 else -1.0)
    return value, np.array([-side * 2.0 * x + 2.0 * (1.0 - x), side])


KINK, START = FunctionObjective(rosenbrock_with_a_kink), np.array([-1.2, 0.5])


def test_a_maximum_on_a_curved_kink_is_found_where_the_trust_region_gives_up():
    smooth = TrustRegion().maximise(KINK, START)
    assert not smooth.converged
    assert smooth.message.startswith("not converged")
    steps = []
    found = KinkedAscent().maximise(KINK, START, steps.append)
    assert found.converged
    assert found.message == AT_A_KINK
    np.testing.assert_allclose(found.vector, [1.0, 1.0], atol=1e-4)
    assert found.objective > smooth.objective
    assert found.gradient_norm <= 1e-6
    assert [step.number for step in steps] == list(range(1, found.n_steps + 1))
    assert len(found.objective_trace) == found.n_steps
    assert np.all(np.diff(found.objective_trace) >= 0)
    np.testing.assert_array_equal(steps[-1].vector, found.vector)
    assert steps[-1].gradient_norm == found.gradient_norm
    for last in (1, smooth.n_steps + 2):
        stopped = KinkedAscent().maximise(KINK, START, lambda step, n=last: step.number == n)
        assert stopped.message == STOPPED
        assert not stopped.converged
        assert stopped.n_steps == last


def top_of_planes(slopes, heights, bowl, start):
    """The ascent over the smallest of several planes less a bowl."""

    def objective(vector):
        planes = slopes @ vector + heights
        lowest = int(np.argmin(planes))
        value = float(planes[lowest] - 0.5 * vector @ bowl @ vector)
        return value, slopes[lowest] - bowl @ vector

    return KinkedAscent().maximise(FunctionObjective(objective), start)


@pytest.mark.parametrize("seed", [0, 24])
def test_the_top_of_a_bowl_of_six_planes_is_certified(seed):
    """Seed 24 climbed to within 2e-13, and went on there in steps that gain nothing."""
    rng = np.random.default_rng(seed)
    slopes = rng.normal(size=(6, 3))
    slopes -= slopes.mean(axis=0)
    heights, root = 0.1 * rng.normal(size=6), rng.normal(size=(3, 3))
    bowl = root @ root.T * 0.3 + 0.01 * np.eye(3)
    found = top_of_planes(slopes, heights, bowl, rng.normal(size=3))
    assert found.converged
    assert found.message == AT_A_KINK
    # The same as a quadratic programme in (x, t): t below every plane.
    best = scipy.optimize.minimize(
        lambda z: 0.5 * z[:3] @ bowl @ z[:3] - z[3],
        np.append(np.zeros(3), heights.min()),
        constraints=[{"type": "ineq", "fun": lambda z: slopes @ z[:3] + heights - z[3]}],
        method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 500},
    )
    assert found.objective == pytest.approx(-best.fun, abs=1e-6)


def test_a_wrong_gradient_is_no_convergence():
    """Every direction goes down, but the gradient promises a rise: the message reports it."""
    wrong = FunctionObjective(lambda vector: (-float(np.abs(vector).sum()), np.ones(2)))
    found = KinkedAscent(max_steps=5).maximise(wrong, np.array([1e-9, 1e-9]))
    assert not found.converged
    assert found.message == STALLED
