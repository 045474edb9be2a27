import numpy as np
import pytest

from serd_core.errors import SerdError
from serd_core.mdp.problem import from_transitions
from serd_core.policies.policy_model import PolicyMatchingPolicy
from serd_core.policies.solved_policy import boltzmann_policy, optimal_policy, soft_policy


def test_the_optimal_policy_takes_the_action_of_highest_value(gridworld):
    problem, weights, table = gridworld.problem, gridworld.weights, gridworld.probabilities
    found = optimal_policy(problem, weights, table)
    assert found.converged
    np.testing.assert_array_equal(found.greedy, found.q.argmax(axis=1))
    np.testing.assert_array_equal(found.probabilities, np.eye(5)[found.greedy])
    np.testing.assert_allclose(found.value, found.q.max(axis=1))


def test_a_cold_expert_is_greedy_and_a_hot_one_is_indifferent(gridworld):
    arguments = (gridworld.problem, gridworld.weights, gridworld.probabilities)
    cold = boltzmann_policy(*arguments, 1e-6).probabilities
    np.testing.assert_allclose(cold.max(axis=1), 1.0, atol=1e-6)
    np.testing.assert_allclose(boltzmann_policy(*arguments, 1e9).probabilities, 0.2, atol=1e-6)


def test_a_temperature_whose_square_is_no_number_leaves_no_scores():
    q = np.array([[1.0, 2.0]])
    with np.errstate(over="ignore"):
        scores = PolicyMatchingPolicy().parameter_scores(np.array([1e200]), q)
    np.testing.assert_array_equal(scores, np.zeros((1, 2, 1)))


def test_probabilities_that_are_none_are_refused_with_the_row(gridworld):
    wrong = gridworld.probabilities.copy()
    wrong[0, 0] = 0.9
    with pytest.raises(SerdError, match=r"state 0, action 0 .* the row sums to 0.9"):
        soft_policy(gridworld.problem, gridworld.weights, wrong)
    with pytest.raises(SerdError, match=r"reward_weights must have shape \(2\), got \(1,\)"):
        soft_policy(gridworld.problem, np.ones(1), gridworld.probabilities)


def test_actions_of_value_0_are_as_good_as_each_other_but_for_rounding():
    """Left and right of the middle cell lead to rewards that cancel the cost of the way there."""
    n = 5
    ways = np.zeros((n, 2, n))
    for state in range(n):
        for action, following in enumerate((max(state - 1, 0), min(state + 1, n - 1))):
            ways[state, action, following] = 1.0
    problem = from_transitions(ways, np.eye(n)[[0, 1, 2, 1, 0]][:, :3], discount=0.9)
    # V(middle) = w2 + .9 w1 + .81 w0 / .1, as actions stay at the ends.
    weights = np.array([1.0, 0.5, -(0.45 + 8.1)])
    found = optimal_policy(problem, weights)
    assert abs(found.value[2]) < 1e-12
    np.testing.assert_array_equal(found.probabilities[2], [0.5, 0.5])
