"""Decisions as columns and as episodes."""

import numpy as np
import pandas as pd
import pytest

import serd_core as sc


def test_a_data_frame_and_back(gridworld):
    frame = pd.DataFrame(gridworld.decisions.columns())
    again = sc.decisions_from_columns(frame)
    for name, column in gridworld.decisions.columns().items():
        np.testing.assert_array_equal(again.columns()[name], column)
    with pytest.raises(sc.SerdError, match=r"got an error for one: .*time_s"):
        sc.decisions_from_columns(frame.drop(columns="time_s"))


def test_episodes_are_states_and_one_action_less():
    found = sc.decisions_from_episodes([([0, 1, 2], [3, 4]), ([5, 6], [7])])
    assert found.next_state.tolist() == [1, 2, 6]
    assert found.action.tolist() == [3, 4, 7]
    assert found.episode.tolist() == [0, 0, 1]
    with pytest.raises(sc.SerdError, match="episode 0 must have one more state than actions"):
        sc.decisions_from_episodes([([0, 1], [3, 4])])


@pytest.mark.parametrize("wrong", [1, ([0, 1], [3], [0.0])])
def test_an_episode_that_is_no_pair_is_named(wrong):
    with pytest.raises(sc.SerdError, match=r"episode 1 must be a pair \(states, actions\), got"):
        sc.decisions_from_episodes([([0, 1], [3]), wrong])


def test_numbers_of_episodes_that_are_text_are_refused():
    decisions = sc.decisions_from_episodes([([0, 1], [3])])
    with pytest.raises(sc.SerdError, match="episodes must be an array of numbers, got <U1"):
        decisions.select_episodes(["a"])
