import numpy as np
import pytest

from serd_core.ascent.trust_region import TrustRegion
from serd_core.learners.serd import fit_pm_serd
from serd_core.policies.solved_policy import boltzmann_policy
from serd_core.posterior.parameters import Block
from serd_core.priors.dirichlet import DirichletPrior
from serd_core.priors.divergence import KldPrior
from serd_core.priors.gaussian import GaussianPrior
from support.small_problems import sampled

#: Does not affect the ratio of rewards and temperature, which is all that policies depend on.
SCALE = GaussianPrior(0.1, Block.POLICY, mean=1.0)
#: Keeps probabilities of outcomes that were never seen from 0.
UNSEEN = DirichletPrior(1.0)


def test_rewards_dynamics_and_temperature_are_recovered_up_to_scale(make_gridworld):
    case = make_gridworld(side=5, n_episodes=1)
    policy = boltzmann_policy(case.problem, case.weights, case.probabilities, 2.0).probabilities
    decisions = sampled(case.problem, policy, case.probabilities, 2000, 40, 0)
    fit = fit_pm_serd(
        case.problem,
        decisions,
        initial_weights=np.ones(2),
        prior=KldPrior(1e-3) + SCALE,
    )
    assert fit.converged
    assert fit.temperature == pytest.approx(1.0, abs=1e-6)
    expected = case.weights / 2.0
    np.testing.assert_allclose(fit.reward_weights / fit.temperature, expected, atol=0.1)
    np.testing.assert_allclose(fit.outcome_probabilities, case.probabilities, atol=0.03)


def test_a_common_factor_of_rewards_and_temperature_changes_no_policy(gridworld):
    problem, table = gridworld.problem, gridworld.probabilities
    one = boltzmann_policy(problem, gridworld.weights, table, 1.5).probabilities
    two = boltzmann_policy(problem, 4 * gridworld.weights, table, 6.0).probabilities
    np.testing.assert_allclose(one, two, atol=1e-9)


@pytest.mark.parametrize("n_episodes", [2, 20])
def test_fits_that_end_on_a_kink_are_certified(make_gridworld, n_episodes):
    case = make_gridworld(side=8, discount=0.99, n_episodes=1)
    policy = boltzmann_policy(case.problem, case.weights, case.probabilities, 2.0).probabilities
    decisions = sampled(case.problem, policy, case.probabilities, n_episodes, 30, n_episodes)
    given = {"initial_weights": np.ones(2), "prior": SCALE + UNSEEN}
    fit = fit_pm_serd(case.problem, decisions, **given)
    assert fit.converged, fit.message
    smooth = fit_pm_serd(case.problem, decisions, ascent=TrustRegion(), **given)
    assert fit.objective >= smooth.objective
