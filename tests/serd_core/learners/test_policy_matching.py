import numpy as np
import pytest

from serd_core.ascent.lbfgs import Lbfgs
from serd_core.errors import SerdError
from serd_core.learners.policy_matching import fit_policy_matching, squared_loss
from serd_core.policies.solved_policy import boltzmann_policy
from support.small_problems import fit_of, sampled


def test_the_gradient_by_q_is_the_finite_difference():
    rng = np.random.default_rng(0)
    counts = rng.integers(0, 5, (4, 3)).astype(float)
    q = rng.normal(size=(4, 3))

    def value(energies):
        weights = np.exp(energies)
        return squared_loss(weights / weights.sum(axis=1, keepdims=True), counts)

    step = 1e-6
    for s in range(4):
        for a in range(3):
            up, down = q.copy(), q.copy()
            up[s, a] += step
            down[s, a] -= step
            numeric = (value(up)[0] - value(down)[0]) / (2 * step)
            assert value(q)[1][s, a] == pytest.approx(numeric, abs=1e-8)


def test_the_weights_of_a_boltzmann_expert_are_recovered(make_gridworld):
    case = make_gridworld(side=5, n_episodes=1)
    policy = boltzmann_policy(case.problem, case.weights, case.probabilities, 1 / 0.7)
    decisions = sampled(case.problem, policy.probabilities, case.probabilities, 2000, 40, 0)
    fit = fit_policy_matching(
        case.problem,
        decisions,
        inverse_temperature=0.7,
        initial_weights=np.ones(2),
        dynamics=case.probabilities,
    )
    np.testing.assert_allclose(fit.reward_weights, case.weights, rtol=0.05)


def test_a_wrong_inverse_temperature_is_refused(gridworld):
    with pytest.raises(SerdError, match="inverse_temperature must be finite and above 0"):
        fit_policy_matching(gridworld.problem, gridworld.decisions, inverse_temperature=0.0)


def test_the_loss_weighs_states_by_how_often_they_were_visited():
    """(3.8) by hand: pi_E is (1, 0) in a state visited thrice, and (0, 1) in one visited once."""
    counts = np.array([[3.0, 0.0], [0.0, 1.0]])
    policy = np.array([[0.6, 0.4], [0.5, 0.5]])
    value, _ = squared_loss(policy, counts)
    assert value == pytest.approx(-0.5 * (0.75 * 2 * 0.4**2 + 0.25 * 2 * 0.5**2))


def test_the_gradient_by_the_weights_is_the_finite_difference_at_any_temperature(gridworld):
    def started(weights):
        return fit_of(
            gridworld,
            weights,
            fit=fit_policy_matching,
            inverse_temperature=0.5,
            dynamics=gridworld.probabilities,
            ascent=Lbfgs(gradient_tolerance=np.inf),
        )

    start, step = np.array([1.0, 1.5]), 1e-5
    numeric = [
        (started(start + step * unit).objective - started(start - step * unit).objective)
        / (2 * step)
        for unit in np.eye(2)
    ]
    assert started(start).gradient_norm == pytest.approx(np.max(np.abs(numeric)), rel=1e-5)
