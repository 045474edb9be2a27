from dataclasses import replace

import numpy as np
import pytest

from lab.posterior.calibration import calibration_ranks, draw_by_laplace, uniformity
from serd_core.bayes.strengths import PriorByEvidence
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import TabularProblem

PRIOR = PriorByEvidence(deviation=2.0, pseudo_count=2.0)


@pytest.fixture
def small() -> TabularProblem:
    """Five states, two actions with an outcome model of three outcomes each, one feature."""
    rng = np.random.default_rng(0)
    models = OutcomeModels(
        rng.integers(5, size=(5, 2, 3)), np.tile([0, 1], (5, 1)), np.ones((5, 2), bool), 2
    )
    features = np.repeat(rng.normal(size=(5, 1, 1)), 2, axis=1)
    return TabularProblem(Mdp(models, 0.8), features, ("one",))


def half_as_wide(problem, decisions, fit, rng):
    """Draws that claim too much."""
    draws = draw_by_laplace(problem, decisions, fit, rng)
    return replace(
        draws,
        reward=(draws.reward + fit.reward_weights) / 2,
        outcome_probabilities=(draws.outcome_probabilities + fit.outcome_probabilities) / 2,
    )


@pytest.mark.parametrize(("draw", "passes"), [(draw_by_laplace, True), (half_as_wide, False)])
def test_ranks_of_the_truth_are_uniform_and_show_a_posterior_that_is_too_narrow(
    small, draw, passes
):
    ranks = calibration_ranks(
        small,
        PRIOR,
        np.random.default_rng(1),
        n_data_sets=48,
        n_episodes=20,
        n_steps=10,
        draw=draw,
    )
    assert ranks.shape == (48, 7)
    # Bonferroni's level for seven numbers.
    assert bool(uniformity(ranks, n_bins=4).min() > 0.05 / 7) == passes
