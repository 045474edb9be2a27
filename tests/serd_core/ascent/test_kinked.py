"""Ascent over kinks: maxima where no gradient vanishes are found and certified."""

import numpy as np

from serd_core.ascent.ascent import AT_A_KINK, STOPPED, FunctionObjective
from serd_core.ascent.kinked import STALLED, KinkedAscent
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
    assert np.all(np.diff(found.objective_trace) >= 0)
    np.testing.assert_array_equal(steps[-1].vector, found.vector)
    assert steps[-1].gradient_norm == found.gradient_norm
    for last in (1, smooth.n_steps + 2):
        stopped = KinkedAscent().maximise(KINK, START, lambda step, n=last: step.number == n)
        assert stopped.message == STOPPED
        assert not stopped.converged
        assert stopped.n_steps == last


def test_a_wrong_gradient_is_no_convergence():
    """Every direction goes down, but the gradient promises a rise: the message reports it."""
    wrong = FunctionObjective(lambda vector: (-float(np.abs(vector).sum()), np.ones(2)))
    found = KinkedAscent(max_steps=5).maximise(wrong, np.array([1e-9, 1e-9]))
    assert not found.converged
    assert found.message == STALLED
