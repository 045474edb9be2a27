"""Several tables become one without mixing their episodes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from serd_app.demonstrations.decision_table import concatenate, concatenate_renumbered
from serd_app.errors import AppError
from serd_core.demonstrations.decisions import Decisions


def table(episodes, source="bag"):
    """Decisions of those episodes, one each, distinguished by their state."""
    numbers = np.array(sorted(episodes), dtype=np.int64)
    return Decisions(numbers, numbers * 1.0, numbers, numbers * 0, numbers, source)


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
