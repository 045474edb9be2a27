"""The way of least expected time, and the policy that takes it where a learned one is trapped."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from serd_core.arrival.arriving_policy import (
    TRAP_PROBABILITY,
    arriving_policy,
    least_time_policy,
    trap_states,
)
from serd_core.grid.grid import Action
from serd_core.grid.navigation import NO_FLOW
from serd_core.policies.solved_policy import optimal_policy
from support.arrival_twin import arrival_by_state
from support.small_problems import room

N_STEPS = 200
#: Of a move (stay, forward, right, back, left), and of waiting.
SURE, STANDS = [0.0, 1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0, 0.0]


def one_second(problem):
    """(S, A) of decisions that all take a second."""
    return np.ones(problem.mdp.available.shape)


def least_time(problem, outcomes):
    return least_time_policy(problem, outcomes, one_second(problem))


def outcomes_of(move, waiting=STANDS):
    return np.array([move, move, move, waiting])


def driven_by(problem, learned, outcomes, n_steps=N_STEPS):
    def likely_of(policy):
        law = arrival_by_state(problem, policy.probabilities, outcomes, n_steps)
        return law.within(n_steps) >= TRAP_PROBABILITY

    return arriving_policy(problem, learned, outcomes, one_second(problem), likely_of)


def test_moves_that_often_fail_take_the_geometric_mean_of_periods_per_cell():
    problem = room(1, 6, 5, NO_FLOW)
    for chance, close in ((0.25, 1e-6), (1e-6, 0.01)):
        found = least_time(problem, outcomes_of([1.0 - chance, chance, 0.0, 0.0, 0.0]))
        assert -found.value == pytest.approx(np.arange(5, -1, -1) / chance, rel=close)
        assert found.greedy[:5].tolist() == [Action.EAST] * 5


def test_a_detour_of_quick_moves_is_the_way_of_least_time_around_a_slow_one():
    problem = room(2, 3, 2, NO_FLOW)
    seconds = one_second(problem)
    seconds[1, Action.EAST] = 9.0
    found = least_time_policy(problem, outcomes_of(SURE), seconds)
    # Two cells to the goal by one slow move (10 s), or around it by four.
    assert found.greedy[[0, 1, 3, 4, 5]].tolist() == [
        *(Action.NORTH, Action.NORTH),
        *(Action.EAST, Action.EAST),
        Action.SOUTH,
    ]
    assert -found.value[:2] == pytest.approx([4.0, 3.0])


def test_waiting_is_no_way_even_where_it_is_learned_to_carry_the_robot_along():
    problem = room(5, 1, 4, NO_FLOW)
    carried = [0.0, 1.0, 0.0, 0.0, 0.0]  # north, where there is no flow
    found = least_time(problem, outcomes_of([0.9, 0.1, 0.0, 0.0, 0.0], carried))
    assert found.greedy[:4].tolist() == [Action.NORTH] * 4


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1))
def test_each_state_follows_a_learned_policy_that_arrives_or_takes_the_least_time(seed):
    rng = np.random.default_rng(seed)
    flow = rng.integers(0, 5, 12)
    problem = room(3, 4, int(rng.integers(12)), np.where(flow == 0, -1, flow))
    outcomes = rng.dirichlet(np.full(5, 0.5), 4) + 1e-9
    outcomes /= outcomes.sum(axis=1, keepdims=True)
    weights = rng.normal(0.0, 3.0, len(problem.feature_names))
    learned = optimal_policy(problem, weights, outcomes)
    found = driven_by(problem, learned, outcomes, n_steps=30)
    fastest = least_time(problem, outcomes)
    chosen = np.where(found.by_time, fastest.greedy, learned.greedy)
    assert np.array_equal(found.policy.greedy, chosen)
    arrives = partial(arrival_by_state, problem, outcome_probabilities=outcomes, n_steps=30)
    driven = arrives(found.policy.probabilities).within(30)
    looping = trap_states(problem.grid.neighbours, found.policy.greedy, problem.goal_states)
    assert not (~found.by_time & (looping | (driven < TRAP_PROBABILITY))).any()
    quickest = arrives(fastest.probabilities).within(30)
    lost = np.maximum(driven, quickest) < TRAP_PROBABILITY
    assert np.array_equal(found.traps.unlikely, lost)


CORRIDOR = np.array([[max(i - 1, 0), i, min(i + 1, 5)] for i in range(6)])
LEFT, STAY, RIGHT = 0, 1, 2


def test_arrows_that_all_lead_to_the_goal_leave_no_trap() -> None:
    assert not trap_states(CORRIDOR, np.full(6, RIGHT), np.array([5])).any()
    # A goal is none even where its arrow leads away.
    assert not trap_states(CORRIDOR, np.full(6, LEFT), np.array([0, 5])).any()


def test_actions_that_are_drawn_lead_to_the_goal_by_some_chance_or_by_none() -> None:
    probabilities = np.tile([0.6, 0.4, 0.0], (6, 1))
    probabilities[3:, RIGHT] = 1e-9
    trapped = trap_states(CORRIDOR, probabilities, np.array([5]))
    assert trapped.tolist() == [True, True, True, False, False, False]


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 10_000), n_states=st.integers(1, 20))
def test_it_agrees_with_walking_along_the_arrows(seed: int, n_states: int) -> None:
    goal, *successor = np.random.default_rng(seed).integers(n_states, size=n_states + 1)
    successor = np.array(successor)
    trapped = trap_states(successor[:, None], np.zeros(n_states, dtype=int), np.array([goal]))
    for first in range(n_states):
        state = first
        for _ in range(n_states):
            if state != goal:
                state = int(successor[state])
        assert trapped[first] == (state != goal)
