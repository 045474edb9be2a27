import numpy as np
import pytest

from lab.estimators.gradient_ascent import GradientAscent
from serd_core.ascent.ascent import FunctionObjective
from serd_core.ascent.lbfgs import Lbfgs
from serd_core.demonstrations.decisions import Decisions
from serd_core.learners.serd import fit_mdce_serd
from serd_core.posterior.parameters import Block
from serd_core.priors.divergence import KldPrior
from serd_core.priors.gaussian import GaussianPrior
from serd_files.errors import USER_ERRORS
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


def test_the_callback_sees_every_step_and_can_stop():
    seen = []

    def stop_after_two(step):
        seen.append(step)
        return len(seen) == 2

    ascent = GradientAscent(step_size=lambda _: 0.15)
    found = ascent.maximise(FunctionObjective(quadratic), np.zeros(2), stop_after_two)
    assert [step.number for step in seen] == [1, 2]
    assert found.message == "stopped by the callback"
    np.testing.assert_array_equal(found.vector, seen[-1].vector)


@pytest.mark.parametrize("max_steps", [0, 1, 2, 5])
def test_no_more_steps_are_taken_than_may_be(max_steps):
    numbers = []
    found = GradientAscent(step_size=lambda _: 1e-3, max_steps=max_steps).maximise(
        FunctionObjective(valley), np.array([-1.2, 1.0]), lambda step: numbers.append(step.number)
    )
    assert numbers == list(range(1, max_steps + 1))
    assert not found.converged
    assert found.message == "not converged: out of steps"


def test_wrong_starts_and_limits_are_refused():
    with pytest.raises(
        USER_ERRORS, match="parameter 1 of 2 became nan; start from smaller weights"
    ):
        GradientAscent().maximise(FunctionObjective(quadratic), np.array([0.0, np.nan]), never)
    with pytest.raises(
        USER_ERRORS, match="gradient_tolerance must not be negative or NaN, got nan"
    ):
        GradientAscent(gradient_tolerance=np.nan)
    with pytest.raises(USER_ERRORS, match="max_steps must not be negative or NaN, got -1"):
        GradientAscent(max_steps=-1)


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


def test_gradient_steps_that_are_too_long_are_distinguished_from_too_few():
    long = GradientAscent(step_size=lambda _: 0.25, max_steps=10)
    found = long.maximise(FunctionObjective(quadratic), np.zeros(2), never)
    assert found.message.endswith("the objective fell on the way, use a smaller step_size")
    short = GradientAscent(step_size=lambda _: 0.01, max_steps=10)
    found = short.maximise(FunctionObjective(quadratic), np.zeros(2), never)
    assert found.message == "not converged: out of steps"


def test_plain_gradient_ascent_of_algorithm_1_finds_the_same_optimum(minimum_example):
    rows = [(0, 0, 1)] * 6 + [(0, 0, 0)] * 4 + [(0, 1, 0)] * 2 + [(0, 1, 1)] * 3
    state, action, following = np.array(rows).T
    zeros = np.zeros(len(rows), int)
    decisions = Decisions(zeros, np.arange(len(rows)), state, action, following)
    prior = KldPrior(1.0) + GaussianPrior(1.0, Block.REWARD)
    arguments = {"initial_weights": np.array([0.3]), "prior": prior}
    slow = fit_mdce_serd(
        minimum_example,
        decisions,
        ascent=GradientAscent(step_size=lambda _: 0.2, gradient_tolerance=1e-7, max_steps=20_000),
        **arguments,
    )
    fast = fit_mdce_serd(
        minimum_example, decisions, ascent=Lbfgs(gradient_tolerance=1e-7), **arguments
    )
    assert slow.converged
    assert fast.converged
    np.testing.assert_allclose(slow.reward_weights, fast.reward_weights, atol=1e-5)
    np.testing.assert_allclose(slow.outcome_probabilities, fast.outcome_probabilities, atol=1e-5)
    assert fast.n_evaluations < slow.n_evaluations
