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
