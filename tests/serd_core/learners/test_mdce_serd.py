import numpy as np
import pytest

import serd_core as sc
from support.small_problems import apart, fit_of


def test_rewards_and_dynamics_are_recovered_from_many_decisions(make_gridworld):
    case = make_gridworld(side=5, n_episodes=1500, n_steps=40)
    fit = fit_of(case, [0.0, 0.0], prior=sc.KldPrior(1e-3))
    assert fit.converged
    assert np.all(np.diff(fit.objective_trace) > -1e-6)
    parts = fit.policy_log_likelihood + fit.dynamics_log_likelihood + fit.log_prior
    assert fit.objective == pytest.approx(parts)
    assert fit.objective == pytest.approx(fit.objective_trace[-1])
    np.testing.assert_allclose(fit.reward_weights, case.weights, atol=0.15)
    np.testing.assert_allclose(fit.outcome_probabilities, case.probabilities, atol=0.02)


@pytest.mark.parametrize("start", [-3.0, 3.0])
def test_both_explanations_of_the_minimum_example_are_found(minimum_example, start):
    """Section 4.6.1: the expert always takes a; what b does is learned from the choice alone."""
    given = {"initial_weights": np.array([start]), "prior": sc.KldPrior(1e-3)}
    fit = sc.fit_mdce_serd(minimum_example, apart(0, 0, [0, 1, 1] * 10), **given)
    by_a, by_b = fit.outcome_probabilities[:, 1]
    assert np.sign(fit.reward_weights[0]) == np.sign(start)
    assert (by_a > by_b) == (start > 0)
    np.testing.assert_allclose(by_a, 2 / 3, atol=0.05)


def test_coupling_leads_from_free_to_tied_blocks(gridworld):
    """A weak coupling prior changes nothing, a strong one makes belief and truth equal."""
    prior = sc.KldPrior(0.1) + sc.KldPrior(0.1, block=sc.Block.BELIEF)
    prior = prior + sc.GaussianPrior(3.0, sc.Block.REWARD)
    given = {"prior": prior, "ascent": sc.TrustRegion()}
    beliefs = sc.FreeBelief(), sc.CoupledBelief(1e-7), sc.CoupledBelief(1e4)
    free, weak, strong = (fit_of(gridworld, [1.0, 1.0], belief=b, **given) for b in beliefs)
    np.testing.assert_allclose(weak.reward_weights, free.reward_weights, atol=1e-3)
    apart, together = (
        np.abs(fit.outcome_probabilities - fit.believed_outcome_probabilities).max()
        for fit in (free, strong)
    )
    assert apart > 0.1
    assert together < 1e-2
