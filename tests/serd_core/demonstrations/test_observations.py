import numpy as np

from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.observations import explained, observe


def table(rows):
    state, action, following = np.array(rows).T
    zeros = np.zeros(len(rows), int)
    return Decisions(zeros, np.arange(len(rows)), state, action, following)


def test_counts_say_everything_about_the_decisions(minimum_example):
    observed = observe(minimum_example.mdp, table([(0, 0, 1), (0, 0, 1), (0, 1, 0), (1, 2, 1)]))
    assert observed.n_decisions == 4
    np.testing.assert_array_equal(observed.state_action, [[2, 1, 0], [0, 0, 1]])
    assert sorted(observed.group_count) == [1, 1, 2]
    # In state 2 both outcomes stay, so two entries belong to that one transition.
    assert len(observed.local_index) == len(observed.entry_group) == 4


def test_decisions_that_learners_would_refuse_are_found_beforehand(minimum_example):
    decisions = table([(0, 0, 1), (1, 0, 1), (1, 2, 0), (0, 0, 9), (5, 0, 0), (0, 7, 0)])
    kept = explained(minimum_example.mdp, decisions)
    np.testing.assert_array_equal(kept, [True, False, False, False, False, False])
    assert observe(minimum_example.mdp, decisions.select(kept)).n_decisions == 1
