"""Trap states: where following the arrows never ends at the goal."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from serd_core.arrival.arriving_policy import trap_states

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
