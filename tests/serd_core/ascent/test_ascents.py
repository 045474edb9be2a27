import numpy as np
import pytest

import serd_core as sc
from serd_core.ascent.ascent import AT_A_KINK, STOPPED, FunctionObjective, Objective
from serd_core.ascent.kinked import STALLED
from serd_core.ascent.trust_region import quadratic_step
from support.objectives import TOP, quadratic, valley

QUADRATIC = FunctionObjective(quadratic)
EACH_ASCENT = pytest.mark.parametrize(
    "ascent",
    [sc.Lbfgs(), sc.TrustRegion(initial_radius=0.5), sc.KinkedAscent()],
    ids=lambda each: type(each).__name__,
)
KINDS = [sc.Lbfgs, sc.TrustRegion, sc.KinkedAscent]


@EACH_ASCENT
def test_the_top_of_a_quadratic_is_found_and_left_in_no_step(ascent):
    found = ascent.maximise(QUADRATIC, np.zeros(2))
    np.testing.assert_allclose(found.vector, TOP, atol=1e-5)
    assert found.converged
    assert found.objective == pytest.approx(5.0)
    assert found.gradient_norm <= 1e-6
    assert found.message == "gradient within tolerance"
    assert len(found.objective_trace) == found.n_steps
    assert ascent.maximise(QUADRATIC, TOP).n_steps == 0


@EACH_ASCENT
def test_the_callback_sees_every_step_and_can_stop(ascent):
    seen = []
    found = ascent.maximise(QUADRATIC, np.zeros(2), lambda s: seen.append(s) or len(seen) == 2)
    assert [step.number for step in seen] == [1, 2]
    assert not found.converged
    assert found.message == "stopped by the callback"
    np.testing.assert_array_equal(found.vector, seen[-1].vector)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("max_steps", [0, 2, 5])
def test_no_ascent_takes_more_steps_than_it_may(kind, max_steps):
    settings = {"smooth": sc.TrustRegion(max_steps=0)} if kind is sc.KinkedAscent else {}
    numbers = []
    found = kind(max_steps=max_steps, **settings).maximise(
        FunctionObjective(valley), np.array([-1.2, 1.0]), lambda step: numbers.append(step.number)
    )
    assert found.n_steps <= max_steps
    assert numbers == list(range(1, found.n_steps + 1))
    assert not found.converged
    assert found.message == "not converged: out of steps"


def test_a_start_that_no_ascent_can_meet_is_refused():
    with pytest.raises(sc.SerdError, match="parameter 1 of 2 became nan; start from smaller weigh"):
        sc.Lbfgs().maximise(QUADRATIC, np.array([0.0, np.nan]))


def test_the_trust_region_climbs_out_of_upward_curvature_and_leaves_flat_directions_alone():
    wave = FunctionObjective(lambda v: (float(np.sin(v[0])), np.cos(v)))
    found = sc.TrustRegion().maximise(wave, np.array([-1.4]))
    assert found.converged
    assert found.objective == pytest.approx(1.0)
    ridge = FunctionObjective(lambda v: (-0.5 * (v.sum() - 1.0) ** 2, np.full(2, 1.0 - v.sum())))
    found = sc.TrustRegion().maximise(ridge, np.array([3.0, 0.0]))
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


WEIGHTS, SHARES = np.array([1.0, 4.0, 9.0]), np.array([0.5, 0.3, 0.2])


class Poisson(Objective):
    """sum w (p x - exp x), whose maximum is log p; counts its Hessians."""

    hessians = 0

    def evaluate(self, vector):
        value = WEIGHTS @ (SHARES * vector - np.exp(vector))
        return float(value), WEIGHTS * (SHARES - np.exp(vector))

    def hessian(self, vector):
        self.hessians += 1
        return -np.diag(WEIGHTS * np.exp(vector))


@pytest.mark.parametrize(
    ("away", "information", "most_hessians"),
    [
        (-np.log(SHARES), None, 5),
        (1e-3, 0.5 * np.diag(WEIGHTS * SHARES), 2),
        (1e-3, 2.0 * np.diag(WEIGHTS * SHARES), 2),
        (-np.log(SHARES), 1e-6 * np.eye(3), 5),
        (-np.log(SHARES), -np.eye(3), 5),
    ],
    ids=["none", "half", "twice", "far too small", "a saddle"],
)
def test_newtons_method_keeps_hessians_and_replaces_wrong_estimates(
    away, information, most_hessians
):
    objective = Poisson()
    found = sc.NewtonAscent().maximise(objective, np.log(SHARES) + away, information=information)
    assert found.converged
    np.testing.assert_allclose(found.vector, np.log(SHARES), atol=1e-7)
    assert objective.hessians <= most_hessians
    assert information is not None or objective.hessians < found.n_steps


def rosenbrock_with_a_kink(vector):
    """Lewis and Overton's example, upside down: its maximum (1, 1) lies on the curved kink."""
    x, y = vector
    bend = x**2 - y
    value = -8.0 * abs(bend) - (1.0 - x) ** 2
    side = 8.0 * (1.0 if bend >= 0 else -1.0)
    return value, np.array([-side * 2.0 * x + 2.0 * (1.0 - x), side])


KINK, START = FunctionObjective(rosenbrock_with_a_kink), np.array([-1.2, 0.5])


def test_a_maximum_on_a_curved_kink_is_found_where_the_trust_region_gives_up():
    smooth = sc.TrustRegion().maximise(KINK, START)
    assert not smooth.converged
    assert smooth.message.startswith("not converged")
    steps = []
    found = sc.KinkedAscent().maximise(KINK, START, steps.append)
    assert found.converged
    assert found.message == AT_A_KINK
    np.testing.assert_allclose(found.vector, [1.0, 1.0], atol=1e-4)
    assert found.objective > smooth.objective
    assert found.gradient_norm <= 1e-6
    assert np.all(np.diff(found.objective_trace) >= 0)
    np.testing.assert_array_equal(steps[-1].vector, found.vector)
    assert steps[-1].gradient_norm == found.gradient_norm
    for last in (1, smooth.n_steps + 2):
        stopped = sc.KinkedAscent().maximise(KINK, START, lambda step, n=last: step.number == n)
        assert stopped.message == STOPPED
        assert not stopped.converged
        assert stopped.n_steps == last


def test_a_wrong_gradient_is_no_convergence():
    """Every direction goes down, but the gradient promises a rise: the message reports it."""
    wrong = FunctionObjective(lambda vector: (-float(np.abs(vector).sum()), np.ones(2)))
    found = sc.KinkedAscent(max_steps=5).maximise(wrong, np.array([1e-9, 1e-9]))
    assert not found.converged
    assert found.message == STALLED
