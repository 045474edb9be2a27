from dataclasses import replace

import numpy as np
import pytest

from lab.posterior.calibration import calibration_ranks, draw_by_sweeps, uniformity
from lab.posterior.families import FAMILIES


def half_as_wide(problem, decisions, fit, rng):
    """Draws that claim too much."""
    draws = draw_by_sweeps(problem, decisions, fit, rng)
    return replace(
        draws,
        reward=(draws.reward + fit.reward_weights) / 2,
        truth=(draws.truth + fit.parameters.truth) / 2,
    )


@pytest.mark.parametrize(("draw", "passes"), [(draw_by_sweeps, True), (half_as_wide, False)])
def test_ranks_of_the_truth_are_uniform_and_show_a_posterior_that_is_too_narrow(draw, passes):
    family, rng = FAMILIES["random MDP"](), np.random.default_rng(1)
    ranks = np.array([calibration_ranks(family, rng, draw) for _ in range(48)])
    assert ranks.shape == (48, 7)
    # Bonferroni's level for seven numbers.
    assert bool(uniformity(ranks, n_bins=4).min() > 0.05 / 7) == passes


@pytest.mark.parametrize("family", FAMILIES)
def test_each_kind_of_world_ranks_all_its_numbers(family):
    world = FAMILIES[family]()
    ranks = calibration_ranks(world, np.random.default_rng(0))
    n = len(world.problem.feature_names) + world.problem.mdp.transitions.n_parameters
    assert ranks.shape == (n,)
    assert np.all((ranks >= 0) & (ranks <= 63))
