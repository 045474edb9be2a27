"""Tables of decisions read back, and several become one without mixing their episodes."""

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
from serd_bag.errors import FileError
from serd_core.semi_markov.timed_decisions import TIMED_COLUMNS, TimedDecisions


def table(episodes, source="bag"):
    """Decisions of those episodes, one each, distinguished by their state."""
    numbers = np.array(sorted(episodes), dtype=np.int64)
    return TimedDecisions(
        numbers,
        numbers * 1.0,
        numbers,
        numbers * 0,
        numbers,
        source,
        dwell_s=np.ones(len(numbers)),
        censored=np.zeros(len(numbers), dtype=bool),
    )


def test_later_tables_number_on():
    joined = concatenate_renumbered([table([0, 1], "a"), table([0, 2], "b"), table([9], "a")])
    assert joined.episode.tolist() == [0, 1, 2, 4, 9]
    assert joined.state.tolist() == [0, 1, 0, 2, 9]
    assert joined.source == "a, episodes 0 to 1; b, episodes 2 to 4; a, episodes 9 to 9"


def test_one_source_stays_as_it_is_and_what_is_labelled_is_not_labelled_again():
    assert concatenate_renumbered([table([0]), table([1])]).source == "bag"
    two = concatenate_renumbered([table([0], "a"), table([0], "b")])
    three = concatenate_renumbered([two, table([0], "c")])
    assert three.source == "a, episodes 0 to 0; b, episodes 1 to 1; c, episodes 2 to 2"


@given(st.lists(st.lists(st.integers(0, 20), unique=True, max_size=5), min_size=1, max_size=5))
def test_no_two_episodes_become_one(groups):
    joined = concatenate_renumbered([table(group) for group in groups])
    assert len(joined) == sum(len(group) for group in groups)
    assert len(joined.episodes) == len(joined)
    assert np.all(np.diff(joined.episode) > 0)


def test_no_table_is_refused():
    with pytest.raises(AppError, match="at least one table"):
        concatenate_renumbered([])


def test_tables_that_keep_their_numbers_are_concatenated_in_order():
    first, second = table([3, 4]), table([0])
    both = concatenate((first, second))
    assert both.episode.tolist() == [3, 4, 0]
    assert both.state.tolist() == [3, 4, 0]
    assert both.source == first.source


@given(
    st.lists(
        st.tuples(
            *[st.integers(0, 999)] * 4,
            st.floats(-1e9, 1e9, allow_nan=False),
            st.floats(1e-9, 1e9),
            st.booleans(),
        ),
        max_size=6,
    )
)
def test_decisions_survive_a_round_trip(tmp_path_factory, rows):
    path = tmp_path_factory.mktemp("table") / "decisions.csv"
    columns = zip(*rows, strict=True) if rows else [[]] * 7
    episode, state, action, following, time_s, dwell_s, censored = map(np.array, columns)
    reached = np.where(censored, state, following) if rows else following
    decisions = TimedDecisions(
        episode, time_s, state, action, reached, 'a, "b"', dwell_s=dwell_s, censored=censored
    )
    save_decisions(path, decisions)
    loaded = load_decisions(path)
    for name in TIMED_COLUMNS:
        assert np.array_equal(getattr(loaded, name), getattr(decisions, name))
    assert loaded.source == (decisions.source if rows else "")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "must have the columns episode, time_s, state, action, next_state, .* got none"),
        ("HEAD\n1,2.0,3.5,4,5,1.0,0,s\n", "line 2, state must be a whole number, got '3.5'"),
        ("HEAD\n1,2.0,-3,4,5,1.0,0,s\n", r"state\[0\] must not be negative, got -3"),
        ("HEAD\n1,nan,3,4,5,1.0,0,s\n", "time_s"),
        ("HEAD\n1,2.0,3,4,5,0.0,0,s\n", r"dwell_s\[0\] must be above 0, got 0.0"),
        ("HEAD\n1,2.0,3,4,5,1.0,2,s\n", "censored must hold booleans"),
        (
            "episode,time_s,state,action,next_state,source\n1,2.0,3,4,5,s\n",
            "must have the columns dwell_s and censored, .*; run 'serd demos' again",
        ),
    ],
)
def test_a_wrong_table_gets_a_sentence(tmp_path, text, sentence):
    path = tmp_path / "decisions.csv"
    path.write_text(text.replace("HEAD", ",".join((*TIMED_COLUMNS, "source"))))
    with pytest.raises(FileError, match=sentence):
        load_decisions(path)
