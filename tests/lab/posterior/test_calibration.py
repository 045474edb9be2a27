from dataclasses import replace

import numpy as np
import pytest

from lab.benchmarks.learning.calibration import PRIOR, small_problem
from lab.posterior.calibration import calibration_ranks, draw_by_laplace, uniformity


def half_as_wide(problem, decisions, fit, rng):
    """Draws that claim too much."""
    draws = draw_by_laplace(problem, decisions, fit, rng)
    return replace(
        draws,
        reward=(draws.reward + fit.reward_weights) / 2,
        outcome_probabilities=(draws.outcome_probabilities + fit.outcome_probabilities) / 2,
    )


@pytest.mark.parametrize(("draw", "passes"), [(draw_by_laplace, True), (half_as_wide, False)])
def test_ranks_of_the_truth_are_uniform_and_show_a_posterior_that_is_too_narrow(draw, passes):
    sizes = {"n_data_sets": 48, "n_episodes": 20, "n_steps": 10}
    rng = np.random.default_rng(1)
    ranks = calibration_ranks(small_problem(), PRIOR, rng, **sizes, draw=draw)
    assert ranks.shape == (48, 7)
    # Bonferroni's level for seven numbers.
    assert bool(uniformity(ranks, n_bins=4).min() > 0.05 / 7) == passes
