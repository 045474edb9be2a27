"""Tables of decisions read back, several as one without mixing their episodes, and up to goals."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from serd_app.demonstrations.decision_table import (
    concatenate,
    concatenate_renumbered,
    load_decisions,
    save_decisions,
)
from serd_app.errors import AppError
from serd_app.learning.learning_files import (
    ending_in,
    episodes_reaching,
    until_goal,
    usual_goal_states,
)
from serd_bag.errors import FileError
from serd_core.demonstrations.decisions import TIMED_COLUMNS, Decisions, TimedDecisions
from serd_core.grid.grid import Grid


def table(episodes, source="bag"):
    """Decisions of those episodes, one each, distinguished by their state."""
    numbers = np.array(sorted(episodes), dtype=np.int64)
    ones = np.ones(len(numbers))
    columns = numbers, 1.0 * numbers, numbers, 0 * numbers, numbers
    return TimedDecisions(*columns, source, dwell_s=ones, censored=ones > 1)


def test_later_tables_number_on_and_their_sources_name_the_episodes_once():
    joined = concatenate_renumbered([table([0, 1], "a"), table([0, 2], "b"), table([9], "a")])
    assert joined.episode.tolist() == [0, 1, 2, 4, 9]
    assert joined.state.tolist() == [0, 1, 0, 2, 9]
    assert joined.source == "a, episodes 0 to 1; b, episodes 2 to 4; a, episodes 9 to 9"
    more = concatenate_renumbered([joined, table([0], "c")])
    assert more.source == f"{joined.source}; c, episodes 10 to 10"
    assert concatenate_renumbered([table([0]), table([1])]).source == "bag"
    both = concatenate([table([3, 4]), table([0])])
    assert (both.episode.tolist(), both.source) == ([3, 4, 0], "bag")
    with pytest.raises(AppError, match="at least one table"):
        concatenate_renumbered([])


@given(st.lists(st.lists(st.integers(0, 20), unique=True, max_size=5), min_size=1, max_size=5))
def test_no_two_episodes_become_one(groups):
    joined = concatenate_renumbered([table(group) for group in groups])
    assert len(joined) == len(joined.episodes) == sum(map(len, groups))
    assert np.all(np.diff(joined.episode) > 0)


def test_a_table_of_something_else_names_the_command_that_makes_one(tmp_path):
    path = tmp_path / "robot.csv"
    path.write_text("timestamp,x,y\n1,2,3\n")
    with pytest.raises(FileError, match="make the table of decisions by 'serd demos'"):
        load_decisions(path)


decision = st.tuples(
    *[st.integers(0, 999)] * 4, st.floats(-1e9, 1e9), st.floats(1e-9, 1e9), st.booleans()
)


@given(st.lists(decision, max_size=6))
def test_decisions_survive_a_round_trip(tmp_path_factory, rows):
    columns = zip(*rows, strict=True) if rows else [[]] * 7
    episode, state, action, following, time_s, dwell_s, censored = map(np.array, columns)
    reached = np.where(censored, state, following) if rows else following
    kept = TimedDecisions(
        episode, time_s, state, action, reached, 'a, "b"', dwell_s=dwell_s, censored=censored
    )
    path = tmp_path_factory.getbasetemp() / "decisions.csv"
    save_decisions(path, kept)
    loaded = load_decisions(path)
    assert all(np.array_equal(getattr(loaded, name), getattr(kept, name)) for name in TIMED_COLUMNS)
    assert loaded.source == (kept.source if rows else "")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "must have the columns episode, time_s, state, action, next_state, .* got none"),
        ("HEAD\n1,2.0,3.5,4,5,1.0,0,s\n", "line 2, state must be a whole number, got '3.5'"),
        ("HEAD\n1,2.0,-3,4,5,1.0,0,s\n", r"state\[0\] must not be negative, got -3"),
        ("HEAD\n1,nan,3,4,5,1.0,0,s\n", "time_s"),
        ("HEAD\n1,2.0,3,4,5,0.0,0,s\n", r"dwell_s\[0\] must be above 0, got 0.0"),
        ("HEAD\n1,2.0,3,4,5,1.0,2,s\n", "censored must hold booleans"),
        ("episode,time_s,state,action,next_state,source\n1,2.0,3,4,5,s\n",
         "must have the columns .*; it has no column 'dwell_s'"),
    ],
)  # fmt: skip
def test_a_wrong_table_gets_a_sentence(tmp_path, text, sentence):
    path = tmp_path / "decisions.csv"
    path.write_text(text.replace("HEAD", ",".join((*TIMED_COLUMNS, "source"))))
    with pytest.raises(FileError, match=sentence):
        load_decisions(path)


def decided(states, following):
    """Decisions of one episode."""
    ones = np.ones(len(states), int)
    return Decisions(0 * ones, np.arange(len(ones)), np.array(states), ones, np.array(following))


def episodes_through(*episodes):
    """One decision per neighbouring pair of each episode's states."""
    rows = [(e, a, b) for e, states in enumerate(episodes) for a, b in pairwise(states)]
    episode, state, following = np.array(rows).T
    return Decisions(episode, np.arange(len(rows)), state, np.ones(len(rows), int), following)


@pytest.mark.parametrize(
    ("decisions", "goal", "expected"),
    [
        (episodes_through([0, 1, 2, 3, 2, 1], [4, 3, 3], [0, 1]), 3, "001 012 023 143 201"),
        (episodes_through([3, 2, 1]), 3, ""),
        # The decision in the goal was dropped.
        (decided([0, 1, 2], [1, 3, 1]), 3, "001 013"),
        (decided([0, 1, 2], [1, 3, 1]), 2, "001 013"),
    ],
)
def test_episodes_end_where_they_first_enter_the_goal(decisions, goal, expected):
    kept = until_goal(decisions, np.array([goal]))
    rows = zip(kept.episode, kept.state, kept.next_state, strict=True)
    assert " ".join("".join(map(str, row)) for row in rows) == expected


def test_the_goal_is_where_episodes_end_or_of_ways_there_and_back_the_one_with_more_decisions():
    row_of_ten = Grid((0.0, 0.0), 1.0, np.ones((1, 10), dtype=bool))
    decisions = episodes_through([0, 1, 2], [5, 4], [3, 2])
    assert usual_goal_states(decisions, row_of_ten).tolist() == [2, 4]
    assert len(ending_in(decisions, np.array([2, 4]))) == len(decisions)
    there = [[0, 1, 2, 3, 4, 5, 6, 7, 8], [0, 2, 4, 6, 8, 9], [0, 3, 6, 9]]
    decisions = episodes_through(*there, [9, 6, 3, 0])
    goal = usual_goal_states(decisions, row_of_ten)
    assert goal.tolist() == [8, 9]
    assert ending_in(decisions, goal).episodes.tolist() == [0, 1, 2]


def test_episodes_reach_the_goal_that_come_to_it_from_elsewhere():
    goal, decisions = np.array([3]), episodes_through([0, 1, 3, 2], [4, 0], [3, 2], [2, 3])
    assert len(episodes_reaching(decisions, goal)) == 2
    beside = decided([0, 1, 3], [1, 2, 4])  # its move into the goal is not recorded
    assert len(episodes_reaching(beside, goal)) == 1
    assert len(episodes_reaching(beside.select([0, 1]), goal)) == 0
