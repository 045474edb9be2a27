import numpy as np
import pytest

from experiments.study.fits.methods import Trial, serd_free
from experiments.study.fits.uniform_prior import uniform_prior
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.posterior.parameters import Block, Parameters
from serd_core.selection.prior_weight import split_episodes


def log_prior(problem, probabilities):
    model = problem.mdp.transitions
    theta = model.parameters_of(probabilities)
    parameters = Parameters(np.zeros(3), theta, theta, np.zeros(0))
    return uniform_prior(problem, Block.TRUTH, pseudo_count=1.5).evaluate(model, parameters).value


def test_it_is_the_sum_of_the_log_probabilities_up_to_a_constant(problem):
    rng = np.random.default_rng(1)
    first, second = rng.dirichlet(np.ones(5), (2, 4))
    expected = 1.5 * (np.log(first).sum() - np.log(second).sum())
    assert log_prior(problem, first) - log_prior(problem, second) == pytest.approx(expected)


def test_with_a_free_belief_the_truth_is_the_m_estimate(settings, problem, shipped_training):
    subset = shipped_training.select_episodes(range(4))
    training, validation = split_episodes(subset, 0.25, np.random.default_rng(0))
    estimate = estimate_dynamics(problem, subset)
    trial = Trial(
        problem,
        settings.learning,
        subset,
        training,
        validation,
        estimate,
        np.random.default_rng(0),
    )
    learned = serd_free(trial)
    assert learned.converged
    np.testing.assert_allclose(learned.truth, estimate, atol=2e-3)
