import numpy as np

from serd_core.ascent.trust_region import TrustRegion
from serd_core.learners.serd import fit_mdce_serd
from serd_core.learners.staged_start import weights_under_initial_dynamics


def test_a_staged_start_is_at_least_as_good_as_random_ones(make_gridworld):
    case = make_gridworld(side=8, discount=0.95, n_episodes=10, n_steps=15)
    ascent = TrustRegion(gradient_tolerance=1e-5, max_steps=100)
    start = weights_under_initial_dynamics(case.problem, case.decisions)
    staged = fit_mdce_serd(case.problem, case.decisions, initial_weights=start, ascent=ascent)
    randoms = [
        fit_mdce_serd(
            case.problem, case.decisions, rng=np.random.default_rng(seed), ascent=ascent
        ).objective
        for seed in range(6)
    ]
    assert staged.objective > np.median(randoms) - 1e-3


def test_weights_stay_finite_where_every_demonstration_agrees(make_gridworld):
    case = make_gridworld(side=4, n_episodes=1, n_steps=1)
    assert np.all(np.isfinite(weights_under_initial_dynamics(case.problem, case.decisions)))
