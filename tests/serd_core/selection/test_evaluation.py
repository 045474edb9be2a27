import numpy as np
import pytest

from serd_core.ascent.lbfgs import Lbfgs
from serd_core.errors import SerdError
from serd_core.learners.mdce_irl import fit_mdce_irl_by_entropy
from serd_core.learners.policy_matching import fit_policy_matching
from serd_core.learners.serd import fit_mdce_serd, fit_pm_serd
from serd_core.policies.solved_policy import boltzmann_policy, soft_policy
from serd_core.selection.evaluation import (
    dynamics_divergence,
    fitted_policy,
    policy_log_likelihood,
    validation_log_likelihood,
)


def test_log_likelihood_is_the_mean_over_decisions(gridworld):
    uniform = np.full((25, 5), 0.2)
    value = policy_log_likelihood(gridworld.problem, gridworld.decisions, uniform)
    assert value == pytest.approx(np.log(0.2))
    never = np.tile([1.0, 0, 0, 0, 0], (25, 1))
    assert policy_log_likelihood(gridworld.problem, gridworld.decisions, never) == -np.inf


def test_divergences_vanish_for_the_truth_only(gridworld):
    problem, table = gridworld.problem, gridworld.probabilities
    visits = np.ones((25, 5))
    assert dynamics_divergence(problem, table, table, visits) == pytest.approx(0)
    other = np.full_like(table, 0.2)
    assert dynamics_divergence(problem, table, other, visits) > 0.1


def test_transitions_are_compared_and_not_outcomes(minimum_example):
    """In state 2 both outcomes stay: how they share does not matter there."""
    visits = np.zeros((2, 3))
    visits[1, 2] = 1.0
    one, two = np.array([[0.9, 0.1], [0.5, 0.5]]), np.array([[0.2, 0.8], [0.5, 0.5]])
    assert dynamics_divergence(minimum_example, one, two, visits) == pytest.approx(0)
    visits[0, 0] = 1.0
    expected = 0.5 * (0.9 * np.log(0.9 / 0.2) + 0.1 * np.log(0.1 / 0.8))
    assert dynamics_divergence(minimum_example, one, two, visits) == pytest.approx(expected)


def test_the_policy_of_a_fit_follows_its_policy_model(gridworld):
    problem, decisions = gridworld.problem, gridworld.decisions
    quick = {"initial_weights": np.ones(2), "ascent": Lbfgs(max_steps=2)}
    soft = fit_mdce_serd(problem, decisions, **quick)
    expected = soft_policy(problem, soft.reward_weights, soft.outcome_probabilities)
    np.testing.assert_allclose(fitted_policy(problem, soft), expected.probabilities)
    matching = fit_pm_serd(problem, decisions, initial_temperature=2.0, **quick)
    expected = boltzmann_policy(
        problem, matching.reward_weights, matching.outcome_probabilities, matching.temperature
    )
    np.testing.assert_allclose(fitted_policy(problem, matching), expected.probabilities)


def test_the_policy_of_reward_weights_alone_is_that_they_were_fitted_with(gridworld):
    problem, decisions = gridworld.problem, gridworld.decisions
    soft = fit_mdce_irl_by_entropy(
        problem, decisions, initial_weights=np.zeros(2), slack=0.01, ascent=Lbfgs(max_steps=3)
    )
    matched = fit_policy_matching(
        problem,
        decisions,
        inverse_temperature=0.5,
        initial_weights=np.ones(2),
        ascent=Lbfgs(max_steps=3),
    )
    for fit, expected in (
        (soft, soft_policy(problem, soft.reward_weights, soft.outcome_probabilities)),
        (
            matched,
            boltzmann_policy(problem, matched.reward_weights, matched.outcome_probabilities, 2.0),
        ),
    ):
        np.testing.assert_allclose(fitted_policy(problem, fit), expected.probabilities)
        assert validation_log_likelihood(problem, decisions, fit) == pytest.approx(
            policy_log_likelihood(problem, decisions, expected.probabilities)
        )


def test_a_fit_carries_the_certificate_of_its_last_solve(gridworld):
    problem, decisions = gridworld.problem, gridworld.decisions
    quick = {"initial_weights": np.ones(2), "ascent": Lbfgs(max_steps=3)}
    serd = fit_mdce_serd(problem, decisions, **quick)
    matched = fit_policy_matching(problem, decisions, **quick)
    for fit in (serd, matched):
        assert 0 <= fit.residual < 1e-6
        assert fit.residual / (1 - problem.mdp.discount) <= fit.error_bound < 1e-5


def test_an_estimate_that_rules_out_what_is_true_diverges_without_bound(minimum_example):
    """As its log-likelihood is -inf; in states that are never visited it does not matter."""
    sure, wrong = np.array([[1.0, 0.0], [1.0, 0.0]]), np.array([[0.0, 1.0], [1.0, 0.0]])
    visits = np.zeros((2, 3))
    visits[0, 0] = 1.0
    assert dynamics_divergence(minimum_example, sure, wrong, visits) == np.inf
    visits[0] = [0.0, 1.0, 0.0]
    assert dynamics_divergence(minimum_example, sure, wrong, visits) == 0.0


def test_visits_without_any_visit_are_refused(gridworld):
    problem, table = gridworld.problem, gridworld.probabilities
    with pytest.raises(SerdError, match="visits must be non-negative with a positive sum"):
        dynamics_divergence(problem, table, table, np.zeros((25, 5)))


def test_dynamics_that_are_no_distribution_are_refused_by_state_and_action(gridworld):
    table = gridworld.probabilities.copy()
    table[2] *= 2
    with pytest.raises(SerdError, match=r"state 0, action 2 .* the row sums to 2.0"):
        dynamics_divergence(gridworld.problem, gridworld.probabilities, table, np.ones((25, 5)))
