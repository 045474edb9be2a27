import numpy as np
import pytest

from serd_core.ascent.ascent import FunctionObjective
from serd_core.ascent.kinked import KinkedAscent
from serd_core.ascent.lbfgs import Lbfgs
from serd_core.ascent.trust_region import TrustRegion, quadratic_step
from serd_core.errors import SerdError
from support.objectives import TOP, never, quadratic, valley

ASCENTS = [Lbfgs(), TrustRegion(initial_radius=0.5)]
EACH_ASCENT = pytest.mark.parametrize("ascent", ASCENTS, ids=lambda ascent: type(ascent).__name__)


@EACH_ASCENT
def test_the_top_of_a_quadratic_is_found(ascent):
    found = ascent.maximise(FunctionObjective(quadratic), np.zeros(2), never)
    np.testing.assert_allclose(found.vector, TOP, atol=1e-5)
    assert found.converged
    assert found.objective == pytest.approx(5.0)
    assert found.gradient_norm <= 1e-6
    assert found.message == "gradient within tolerance"
    assert len(found.objective_trace) == found.n_steps


@EACH_ASCENT
def test_the_callback_sees_every_step_and_can_stop(ascent):
    seen = []

    def stop_after_two(step):
        seen.append(step)
        return len(seen) == 2

    found = ascent.maximise(FunctionObjective(quadratic), np.zeros(2), stop_after_two)
    assert [step.number for step in seen] == [1, 2]
    assert not found.converged
    assert found.message == "stopped by the callback"
    np.testing.assert_array_equal(found.vector, seen[-1].vector)


@pytest.mark.parametrize("kind", [Lbfgs, TrustRegion, KinkedAscent])
@pytest.mark.parametrize("max_steps", [0, 1, 2, 5])
def test_no_ascent_takes_more_steps_than_it_may(kind, max_steps):
    settings = {"smooth": TrustRegion(max_steps=0)} if kind is KinkedAscent else {}
    numbers = []
    found = kind(max_steps=max_steps, **settings).maximise(
        FunctionObjective(valley), np.array([-1.2, 1.0]), lambda step: numbers.append(step.number)
    )
    assert found.n_steps <= max_steps
    assert numbers == list(range(1, found.n_steps + 1))
    assert not found.converged
    assert found.message == "not converged: out of steps"


@pytest.mark.parametrize("ascent", [Lbfgs(), TrustRegion(), KinkedAscent()])
def test_an_ascent_does_not_evaluate_at_parameters_that_are_not_finite(ascent):
    with pytest.raises(SerdError, match="parameter 1 of 2 became nan; start from smaller weights"):
        ascent.maximise(FunctionObjective(quadratic), np.array([0.0, np.nan]), never)


@EACH_ASCENT
def test_starting_at_the_top_takes_no_step(ascent):
    found = ascent.maximise(FunctionObjective(quadratic), TOP, never)
    assert found.converged
    assert found.n_steps == 0


def test_the_trust_region_climbs_out_of_a_region_of_upward_curvature():
    def wave(vector):
        return float(np.sin(vector[0])), np.array([np.cos(vector[0])])

    found = TrustRegion().maximise(FunctionObjective(wave), np.array([-1.4]), never)
    assert found.converged
    assert found.objective == pytest.approx(1.0)


def test_a_flat_direction_is_left_alone():
    def ridge(vector):
        total = vector.sum()
        return -0.5 * (total - 1.0) ** 2, np.full(2, 1.0 - total)

    found = TrustRegion().maximise(FunctionObjective(ridge), np.array([3.0, 0.0]), never)
    assert found.converged
    np.testing.assert_allclose(found.vector, [2.0, -1.0], atol=1e-6)


def test_a_step_is_never_longer_than_its_radius():
    rng = np.random.default_rng(0)
    for _ in range(50):
        square = rng.normal(size=(4, 4))
        curvatures, directions = np.linalg.eigh(square + square.T)
        radius = rng.uniform(0.01, 3.0)
        step = quadratic_step(rng.normal(size=4), curvatures, directions, radius)
        assert np.linalg.norm(step) <= radius * (1 + 1e-6)


@pytest.mark.parametrize("kind", [KinkedAscent, Lbfgs, TrustRegion])
def test_limits_that_no_ascent_can_meet_are_refused(kind):
    with pytest.raises(SerdError, match="gradient_tolerance must not be negative or NaN, got nan"):
        kind(gradient_tolerance=np.nan)
    with pytest.raises(SerdError, match="max_steps must not be negative or NaN, got -1"):
        kind(max_steps=-1)
