import numpy as np
import pytest

from lab.estimators.gradient_ascent import GradientAscent
from serd_core.ascent.ascent import FunctionObjective
from support.objectives import TOP, never, quadratic, valley


def test_the_top_of_a_quadratic_is_found():
    ascent = GradientAscent(step_size=lambda _: 0.15)
    found = ascent.maximise(FunctionObjective(quadratic), np.zeros(2), never)
    np.testing.assert_allclose(found.vector, TOP, atol=1e-5)
    assert found.converged
    assert found.objective == pytest.approx(5.0)
    assert found.gradient_norm <= 1e-6
    assert found.message == "gradient within tolerance"
    assert len(found.objective_trace) == found.n_steps
    assert ascent.maximise(FunctionObjective(quadratic), TOP, never).n_steps == 0


def test_a_gradient_step_to_a_point_that_is_not_finite_is_reported_and_not_taken():
    start = np.array([-1.2, 1.0])
    ascent = GradientAscent(step_size=lambda number: 1e-3 if number == 1 else 1e200)
    found = ascent.maximise(FunctionObjective(valley), start, never)
    assert found.message.startswith(
        "not converged: a step reached a point where the objective is not finite"
    )
    assert not found.converged
    assert found.n_steps == 1
    np.testing.assert_array_equal(found.vector, start + 1e-3 * valley(start)[1])
