import numpy as np
import pandas as pd
import pytest

import serd_core as sc
from serd_core.demonstrations.decisions import (
    Decisions,
    start_distribution,
    state_action_counts,
    state_counts,
)
from serd_core.errors import SerdError


def five_decisions() -> Decisions:
    return Decisions(
        episode=[3, 3, 3, 7, 7],
        time_s=[0.0, 2.0, 4.0, 10.0, 12.0],
        state=[0, 1, 1, 2, 1],
        action=[1, 0, 0, 1, 1],
        next_state=[1, 1, 2, 1, 2],
        source="by hand",
    )


def test_counts_of_states_and_actions_add_up_to_the_decisions():
    decisions = five_decisions()
    counts = state_action_counts(decisions, 3, 2)
    np.testing.assert_array_equal(counts, [[0, 1], [2, 1], [0, 1]])
    np.testing.assert_array_equal(counts.sum(axis=1), state_counts(decisions, 3))
    assert counts.sum() == len(decisions)


def test_start_distribution_uses_the_first_decision_of_each_episode():
    np.testing.assert_allclose(start_distribution(five_decisions(), 4), [0.5, 0, 0.5, 0])


def test_the_first_decision_is_that_of_the_earliest_time_whatever_the_rows():
    turned = five_decisions().select(np.array([4, 2, 0, 3, 1]))
    np.testing.assert_allclose(start_distribution(turned, 4), [0.5, 0, 0.5, 0])


def test_no_decisions_have_no_start():
    nothing = five_decisions().select(np.zeros(5, bool))
    with pytest.raises(SerdError, match="must hold at least one decision"):
        start_distribution(nothing, 4)


def test_columns_cannot_be_changed_afterwards():
    with pytest.raises(ValueError, match="read-only"):
        five_decisions().state[0] = 1


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"state": [0, 1]}, r"state must have one entry per decision \(1 as in time_s\), got 2"),
        ({"state": [-1]}, r"state\[0\] must not be negative, got -1"),
        ({"action": [0.5]}, r"action\[0\] must be a whole number, got 0.5"),
        ({"time_s": [np.nan]}, r"time_s\[0\] must be finite, got nan"),
        ({"episode": ["a"]}, r"episode must be an array of numbers, got <U1 such as \['a'\]"),
        ({"episode": [[1], [1, 2]]}, "episode must be an array of numbers, which this is not"),
        ({"state": [1e30]}, r"state\[0\] must be below 2\*\*63 in size, got 1e\+30"),
        ({"state": np.array([2**64 - 1], dtype=np.uint64)}, r"must be .* got 1\.844\d+e\+19"),
        ({"state": [1j]}, "state must be an array of numbers, got complex128"),
        (
            {"time_s": np.array(["2020-01-01"], "M8[D]")},
            "time_s must .* got datetime64.* in seconds",
        ),
    ],
)
def test_wrong_columns_are_refused_with_the_place(change, sentence):
    columns = {"episode": [0], "time_s": [0.0], "state": [0], "action": [0], "next_state": [0]}
    with pytest.raises(SerdError, match=sentence):
        Decisions(**(columns | change))


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda given: given.select([10**6]), r"rows\[0\] must be a row from 0 to 4, got 1000000"),
        (lambda given: given.select([-1]), r"rows\[0\] must be a row from 0 to 4, got -1"),
        (lambda given: given.select([True]), r"rows must have shape \(5\), got \(1,\)"),
        (lambda given: given.select(["a"]), "rows must be an array of numbers"),
        (lambda given: given.select_episodes([3, 4]), r"episodes must be among \[3, 7\], got 4"),
        (
            lambda given: given.select_episodes(["a"]),
            "episodes must be an array of numbers, got <U1",
        ),
        (lambda given: state_counts(given, 2), r"state\[3\] must be below 2, got 2"),
        (lambda given: state_action_counts(given, 3, 1), r"action\[0\] must be below 1, got 1"),
    ],
)
def test_what_is_not_there_is_refused(call, sentence):
    with pytest.raises(SerdError, match=sentence):
        call(five_decisions())


def test_actions_are_hidden_by_a_mask_of_all_rows_only():
    hidden = five_decisions().with_hidden_actions([True, False, False, False, True])
    assert hidden.action.tolist() == [-1, 0, 0, 1, -1]
    with pytest.raises(SerdError, match=r"rows must have shape \(5\), got \(1,\)"):
        five_decisions().with_hidden_actions([True])


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
