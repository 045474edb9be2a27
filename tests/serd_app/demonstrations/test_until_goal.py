"""What is left of episodes that go on after the goal."""

from itertools import pairwise

import numpy as np

from serd_app.demonstrations.until_goal import last_states, n_reaching, until_goal
from serd_core.demonstrations.decisions import Decisions


def table(*episodes):
    """One decision per neighbouring pair of each episode's states."""
    rows = [(e, a, b) for e, states in enumerate(episodes) for a, b in pairwise(states)]
    episode, state, following = np.array(rows).T
    return Decisions(episode, np.arange(len(rows)), state, np.ones(len(rows), int), following)


def test_episodes_end_where_they_first_enter_the_goal():
    kept = until_goal(table([0, 1, 2, 3, 2, 1], [4, 3, 3], [0, 1]), np.array([3]))
    assert list(zip(kept.episode, kept.state, kept.next_state, strict=True)) == [
        (0, 0, 1),
        (0, 1, 2),
        (0, 2, 3),
        (1, 4, 3),
        (2, 0, 1),
    ]


def test_an_episode_that_starts_in_the_goal_gives_nothing():
    assert len(until_goal(table([3, 2, 1]), np.array([3]))) == 0


def test_the_last_state_of_every_episode_counts_once():
    assert last_states(table([0, 1, 2], [5, 4], [3, 2])).tolist() == [2, 4]


def test_what_follows_the_goal_is_left_out_also_where_the_decision_in_it_was_dropped():
    ones = np.ones(3, int)
    decisions = Decisions(0 * ones, np.arange(3), np.array([0, 1, 2]), ones, np.array([1, 3, 1]))
    assert until_goal(decisions, np.array([3])).state.tolist() == [0, 1]


def test_episodes_reach_the_goal_that_come_to_it_from_elsewhere():
    goal = np.array([3])
    assert n_reaching(table([0, 1, 3, 2], [4, 0], [3, 2], [2, 3]), goal) == 2
    ones = np.ones(3, int)
    beside = Decisions(0 * ones, np.arange(3), np.array([0, 1, 3]), ones, np.array([1, 2, 4]))
    assert n_reaching(beside, goal) == 1
    assert n_reaching(beside.select([0, 1]), goal) == 0
