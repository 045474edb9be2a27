"""Learners that match the policy: cloning, policy-matching IRL and policy-matching SERD."""

import numpy as np
import pytest

import serd_core as sc
from serd_core.learners.policy_matching import squared_loss
from support.small_problems import apart, fit_of, sampled

#: Does not affect the ratio of rewards and temperature, which is all that policies depend on.
SCALE = sc.GaussianPrior(0.1, sc.Block.POLICY, mean=1.0)


def test_cloned_counts_are_smoothed_over_the_available_actions(minimum_example):
    decisions = apart(0, 0, [0, 0, 1])
    policy = sc.clone_behaviour(minimum_example, decisions, pseudo_count=0.5)
    np.testing.assert_allclose(policy, [[3.5 / 4, 0.5 / 4, 0], [0, 0, 1]])


def test_the_loss_weighs_visited_states_and_has_the_gradient_of_differences():
    """(3.8) by hand: pi_E is (1, 0) in a state visited thrice, and (0, 1) in one visited once."""
    counts = np.array([[3.0, 0.0], [0.0, 1.0]])
    value, _ = squared_loss(np.array([[0.6, 0.4], [0.5, 0.5]]), counts)
    assert value == pytest.approx(-0.5 * (0.75 * 2 * 0.4**2 + 0.25 * 2 * 0.5**2))
    rng = np.random.default_rng(0)
    counts, q = rng.integers(0, 5, (4, 3)).astype(float), rng.normal(size=(4, 3))

    def at(energies):
        weights = np.exp(energies)
        return squared_loss(weights / weights.sum(axis=1, keepdims=True), counts)

    for unit in np.eye(12).reshape(12, 4, 3):
        numeric = (at(q + 1e-6 * unit)[0] - at(q - 1e-6 * unit)[0]) / 2e-6
        assert np.sum(at(q)[1] * unit) == pytest.approx(numeric, abs=1e-8)


def test_the_gradient_by_the_weights_is_the_finite_difference_at_any_temperature(gridworld):
    given = {"inverse_temperature": 0.5, "dynamics": gridworld.probabilities}
    given |= {"fit": sc.fit_policy_matching, "ascent": sc.Lbfgs(gradient_tolerance=np.inf)}

    def started(weights):
        return fit_of(gridworld, weights, **given)

    start, step = np.array([1.0, 1.5]), 1e-5 * np.eye(2)
    sides = [(started(start + s).objective, started(start - s).objective) for s in step]
    numeric = np.max(np.abs(np.diff(sides))) / 2e-5
    assert started(start).gradient_norm == pytest.approx(numeric, rel=1e-5)


def test_a_fit_that_ends_on_a_kink_is_certified(make_gridworld):
    case = make_gridworld(side=8, discount=0.99, n_episodes=1)
    policy = sc.boltzmann_policy(case.problem, case.weights, case.probabilities, 2.0)
    decisions = sampled(case.problem, policy.probabilities, case.probabilities, 20, 30, 20)
    given = {"initial_weights": np.ones(2), "prior": SCALE + sc.DirichletPrior(1.0)}
    fit = sc.fit_pm_serd(case.problem, decisions, **given)
    assert fit.converged, fit.message
    smooth = sc.fit_pm_serd(case.problem, decisions, ascent=sc.TrustRegion(), **given)
    assert fit.objective >= smooth.objective
