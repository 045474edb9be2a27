"""Remaining time from every state, against the forward chain, closed forms and brute force."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import nbinom

from serd_core.arrival.chain import arrival_time_distribution, policy_chain
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.dynamics.sparse_model import fixed_transitions
from serd_core.grid.grid import Action
from serd_core.mdp.mdp import Mdp
from serd_core.policies.solved_policy import soft_policy
from support.arrival_twin import arrival_by_state
from support.small_problems import always, room


def random_case(seed):
    """A 4 x 3 room with random flow, goal, policy and outcomes."""
    rng = np.random.default_rng(seed)
    problem = room(4, 3, int(rng.integers(12)), rng.integers(1, 5, 12))
    policy = rng.dirichlet(np.ones(5), 12)
    policy[problem.goal_states] = np.eye(5)[Action.WAIT]
    return problem, policy, rng.dirichlet(np.ones(5), 4)


@settings(deadline=None, max_examples=12)
@given(st.integers(0, 10_000))
def test_each_column_is_the_forward_chain_from_that_state(seed):
    problem, policy, table = random_case(seed)
    every = arrival_by_state(problem, policy, table, 30)
    for state in range(problem.mdp.n_states):
        start = np.eye(problem.mdp.n_states)[state]
        forward = arrival_time_distribution(problem, policy, table, start, 30)
        np.testing.assert_allclose(every.cdf[:, state], forward.cdf, atol=1e-12)
        assert every.arrival_probability[state] == pytest.approx(forward.arrival_probability)


def test_the_remaining_time_through_a_corridor_is_negative_binomial():
    problem = room(6, 1, 5)
    policy = always(problem, Action.NORTH)
    table = np.tile([0.6, 0.4, 0, 0, 0], (4, 1))
    every = arrival_by_state(problem, policy, table, 40)
    for state in range(5):
        to_go = 5 - state
        expected = nbinom.cdf(np.arange(41) - to_go, to_go, 0.4)
        np.testing.assert_allclose(every.cdf[:, state], expected, atol=1e-12)


def test_the_mean_remaining_time_is_that_of_the_law_cut_off_at_the_horizon():
    problem = room(4, 1, 3)
    policy = always(problem, Action.NORTH)
    table = np.tile([0.5, 0.5, 0, 0, 0], (4, 1))
    every = arrival_by_state(problem, policy, table, 25)
    mass = np.diff(every.cdf, axis=0, prepend=0.0)
    cut_off = mass.T @ np.arange(26) + 25 * (1 - every.cdf[-1])
    np.testing.assert_allclose(every.mean_steps, cut_off)
    assert every.mean_steps[0] == pytest.approx(6.0, abs=1e-4)


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10_000), st.integers(0, 20))
def test_not_having_arrived_is_the_mixture_over_where_it_may_be(seed, elapsed):
    """Law given no arrival = sum over states of P(there now | not arrived) times law from there."""
    problem, policy, table = random_case(seed)
    n_states = problem.mdp.n_states
    start = np.full(n_states, 1.0 / n_states)
    whole = arrival_time_distribution(problem, policy, table, start, 60)
    every = arrival_by_state(problem, policy, table, 60 - elapsed)
    done = whole.cdf[elapsed]
    chain = policy_chain(problem.mdp, policy, table).toarray()
    there, going = start, np.arange(n_states) != problem.goal_states[0]
    for _ in range(elapsed):
        there = (there * going) @ chain
    there = there * going / (there * going).sum()
    np.testing.assert_allclose(
        (whole.cdf[elapsed:] - done) / (1 - done), every.cdf @ there, atol=1e-9
    )
    ever = (whole.arrival_probability - done) / (1 - done)
    assert every.arrival_probability @ there == pytest.approx(ever, abs=1e-7)


@settings(deadline=None, max_examples=5)
@given(st.integers(0, 1000))
def test_sampled_episodes_that_are_still_under_way_take_as_long_as_predicted(seed):
    """Brute force: of 4000 sampled episodes, those in one state after 3 periods."""
    rng = np.random.default_rng(seed)
    problem = room(4, 3, int(rng.integers(12)), rng.integers(1, 5, 12))
    table = rng.dirichlet([1.0, 4.0, 1.0, 1.0, 1.0], 4)
    policy = soft_policy(problem, np.array([3.0, 0.3, 0.1]), table).probabilities
    start = np.eye(problem.mdp.n_states)[(problem.goal_states[0] + 6) % problem.mdp.n_states]
    sampled = sample_decisions(
        problem.mdp, policy, table, start, n_episodes=4000, n_steps=400, rng=rng
    )
    at_three = sampled.time_s == 3
    state = int(np.bincount(sampled.state[at_three]).argmax())
    episodes = sampled.episode[at_three & (sampled.state == state)]
    lengths = np.bincount(sampled.episode)[episodes] - 3
    every = arrival_by_state(problem, policy, table, 60)
    measured = np.array([(lengths <= n).mean() for n in range(61)])
    # Dvoretzky-Kiefer-Wolfowitz: exceeded once in 10^6.
    allowed = np.sqrt(np.log(2e6) / (2 * len(lengths)))
    assert np.abs(measured - every.cdf[:, state]).max() < allowed


def test_the_probability_within_some_periods_is_cut_at_the_horizon():
    problem = room(3, 1, 2)
    policy = always(problem, Action.NORTH)
    every = arrival_by_state(problem, policy, np.tile([0.5, 0.5, 0, 0, 0], (4, 1)), 5)
    assert every.within(-1).tolist() == [0, 0, 1]
    assert every.within(2)[1] == pytest.approx(0.75)
    assert every.within(99).tolist() == every.cdf[-1].tolist()


def test_a_goal_that_can_be_left_counts_as_arrived_all_the_same():
    """Two states, and the one action goes to the other."""
    there_and_back = fixed_transitions((2, 1), [0, 1], [0, 0], [1, 0], np.ones(2))
    problem = SimpleNamespace(mdp=Mdp(there_and_back, 0.9), goal_states=np.array([1]))
    table = arrival_by_state(problem, np.ones((2, 1)), np.ones(2), 3)
    np.testing.assert_array_equal(table.cdf, [[0, 1], [1, 1], [1, 1], [1, 1]])
    forward = arrival_time_distribution(problem, np.ones((2, 1)), np.ones(2), np.eye(2)[0], 3)
    np.testing.assert_array_equal(forward.cdf, table.cdf[:, 0])
