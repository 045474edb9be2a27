import numpy as np
import pytest

from serd_core.errors import SerdError
from serd_core.learners.pm_serd import fit_pm_serd
from serd_core.parameters import Block
from serd_core.policies.solved_policy import boltzmann_policy
from serd_core.priors.divergence import KldPrior
from serd_core.priors.gaussian import GaussianPrior
from serd_core.simulation import sample_decisions


def test_rewards_dynamics_and_temperature_are_recovered_up_to_scale(make_gridworld):
    case = make_gridworld(side=5, n_episodes=1)
    policy = boltzmann_policy(case.problem, case.weights, case.probabilities, 2.0).probabilities
    decisions = sample_decisions(
        case.problem.mdp,
        policy,
        case.probabilities,
        np.full(25, 0.04),
        n_episodes=2000,
        n_steps=40,
        rng=np.random.default_rng(0),
    )
    fit = fit_pm_serd(
        case.problem,
        decisions,
        initial_weights=np.ones(2),
        prior=KldPrior(1e-3) + GaussianPrior(3.0, Block.REWARD) + GaussianPrior(3.0, Block.POLICY),
    )
    assert fit.gradient_norm < 1e-3
    expected = case.weights / 2.0
    np.testing.assert_allclose(fit.reward_weights / fit.temperature, expected, atol=0.1)
    np.testing.assert_allclose(fit.outcome_probabilities, case.probabilities, atol=0.03)


def test_a_common_factor_of_rewards_and_temperature_changes_no_policy(gridworld):
    problem, table = gridworld.problem, gridworld.probabilities
    one = boltzmann_policy(problem, gridworld.weights, table, 1.5).probabilities
    two = boltzmann_policy(problem, 4 * gridworld.weights, table, 6.0).probabilities
    np.testing.assert_allclose(one, two, atol=1e-9)


def test_a_temperature_that_is_not_positive_is_refused(gridworld):
    with pytest.raises(SerdError, match="start_temperature must be finite and above 0, got 0"):
        fit_pm_serd(
            gridworld.problem,
            gridworld.decisions,
            initial_weights=np.ones(2),
            initial_temperature=0.0,
        )
    with pytest.raises(SerdError, match="temperature must be finite and above 0, got -1"):
        boltzmann_policy(gridworld.problem, np.ones(2), gridworld.probabilities, -1.0)
