"""Decisions up to the goal."""

from itertools import pairwise

import numpy as np

from serd_app.demonstrations.decision_table import (
    _neighbouring,
    ending_in,
    episodes_reaching,
    until_goal,
    usual_goal_states,
)
from serd_core.demonstrations.decisions import Decisions
from serd_core.grid.grid import Grid


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


ROW_OF_TEN = Grid((0.0, 0.0), 1.0, np.ones((1, 10), dtype=bool))


def test_all_states_in_which_episodes_end_are_the_goal():
    decisions = table([0, 1, 2], [5, 4], [3, 2])
    assert usual_goal_states(decisions, ROW_OF_TEN).tolist() == [2, 4]
    assert len(ending_in(decisions, np.array([2, 4]))) == len(decisions)


def test_of_episodes_there_and_back_the_way_with_more_decisions_counts():
    """Three episodes end at 8 or 9, where one begins that ends at 0, where they begin."""
    there = [[0, 1, 2, 3, 4, 5, 6, 7, 8], [0, 2, 4, 6, 8, 9], [0, 3, 6, 9]]
    decisions = table(*there, [9, 6, 3, 0])
    goal = usual_goal_states(decisions, ROW_OF_TEN)
    assert goal.tolist() == [8, 9]
    assert ending_in(decisions, goal).episodes.tolist() == [0, 1, 2]


def test_ends_with_at_most_two_cells_between_them_are_in_one_group():
    room = Grid((0.0, 0.0), 1.0, np.ones((8, 12), dtype=bool))
    near, far = [(3.5, 0.5), (6.5, 3.5)], [(0.5, 7.5), (10.5, 0.5)]
    states = np.array([room.state_at(*place) for place in (*near, *far)])
    groups = {tuple(each.tolist()) for each in _neighbouring(states, room)}
    assert groups == {tuple(states[:2].tolist()), *((each,) for each in states[2:].tolist())}


def test_what_follows_the_goal_is_left_out_also_where_the_decision_in_it_was_dropped():
    ones = np.ones(3, int)
    decisions = Decisions(0 * ones, np.arange(3), np.array([0, 1, 2]), ones, np.array([1, 3, 1]))
    assert until_goal(decisions, np.array([3])).state.tolist() == [0, 1]
    assert until_goal(decisions, np.array([2])).state.tolist() == [0, 1]


def test_episodes_reach_the_goal_that_come_to_it_from_elsewhere():
    goal = np.array([3])
    assert len(episodes_reaching(table([0, 1, 3, 2], [4, 0], [3, 2], [2, 3]), goal)) == 2
    ones = np.ones(3, int)
    beside = Decisions(0 * ones, np.arange(3), np.array([0, 1, 3]), ones, np.array([1, 2, 4]))
    assert len(episodes_reaching(beside, goal)) == 1
    assert len(episodes_reaching(beside.select([0, 1]), goal)) == 0
