import numpy as np
import pytest

import serd_core as sc
from serd_core.demonstrations.decisions import (
    Decisions,
    start_distribution,
    state_action_counts,
    state_counts,
)
from serd_core.demonstrations.observations import explained, observe
from serd_core.errors import SerdError
from support.refusals import refusals
from support.small_problems import apart


def five_decisions() -> Decisions:
    moves = {"state": [0, 1, 1, 2, 1], "action": [1, 0, 0, 1, 1], "next_state": [1, 1, 2, 1, 2]}
    return Decisions([3, 3, 3, 7, 7], [0.0, 2.0, 4.0, 10.0, 12.0], **moves, source="by hand")


def test_counts_of_states_and_actions_add_up_to_the_decisions():
    decisions = five_decisions()
    counts = state_action_counts(decisions, 3, 2)
    np.testing.assert_array_equal(counts, [[0, 1], [2, 1], [0, 1]])
    np.testing.assert_array_equal(counts.sum(axis=1), state_counts(decisions, 3))
    assert counts.sum() == len(decisions)


def test_the_first_decision_of_each_episode_is_that_of_the_earliest_time_whatever_the_rows():
    turned = five_decisions().select(np.array([4, 2, 0, 3, 1]))
    for given in (five_decisions(), turned):
        np.testing.assert_allclose(start_distribution(given, 4), [0.5, 0, 0.5, 0])


def test_episodes_are_states_and_one_action_less():
    found = sc.decisions_from_episodes([([0, 1, 2], [3, 4]), ([5, 6], [7])])
    assert found.next_state.tolist() == [1, 2, 6]
    assert found.action.tolist() == [3, 4, 7]
    assert found.episode.tolist() == [0, 0, 1]


ONE = {"episode": [0], "time_s": [0.0], "state": [0], "action": [0], "next_state": [0]}
FIVE, FROM_EPISODES, PAIR = five_decisions(), sc.decisions_from_episodes, ([0, 1], [3])
DATE, LARGE = np.array(["2020-01-01"], "M8[D]"), np.array([2**64 - 1], dtype=np.uint64)


test_what_is_no_decision_and_not_there_is_refused = refusals(
    (lambda: Decisions(**ONE | {"state": [0, 1]}), "state must have one entry per decision"),
    (lambda: Decisions(**ONE | {"state": [-1]}), r"state\[0\] must not be negative, got -1"),
    (lambda: Decisions(**ONE | {"action": [0.5]}), r"action\[0\] must be a whole number"),
    (lambda: Decisions(**ONE | {"episode": [[1], [1, 2]]}), "of numbers, which this is not"),
    (lambda: Decisions(**ONE | {"state": [1e30]}), r"state\[0\] must be below 2\*\*63 in size"),
    (lambda: Decisions(**ONE | {"state": LARGE}), r"must be .* got 1\.844\d+e\+19"),
    (lambda: Decisions(**ONE | {"time_s": DATE}), "time_s must .* got datetime64.* in seconds"),
    (lambda: FIVE.select([-1]), r"rows\[0\] must be a row from 0 to 4, got -1"),
    (lambda: FIVE.with_hidden_actions([True]), r"rows must have shape \(5\), got \(1,\)"),
    (lambda: FIVE.select_episodes([3, 4]), r"episodes must be among \[3, 7\], got 4"),
    (lambda: state_counts(FIVE, 2), r"state\[3\] must be below 2, got 2"),
    (lambda: start_distribution(FIVE.select([]), 4), "must hold at least one decision"),
    (lambda: FROM_EPISODES([([0, 1], [3, 4])]), "episode 0 must have one more state than act"),
    (lambda: FROM_EPISODES([PAIR, 1]), r"episode 1 must be a pair \(states, actions\), got"),
    (lambda: FROM_EPISODES([]), "episodes must hold at least one episode, got none"),
)


def test_counts_are_of_the_decisions_that_the_problem_explains(minimum_example):
    """Learners refuse the others; in state 2 both outcomes stay: two entries of one transition."""
    observed = observe(minimum_example, apart([0, 0, 0, 1], [0, 0, 1, 2], [1, 1, 0, 1]))
    assert observed.n_decisions == 4
    np.testing.assert_array_equal(observed.state_action, [[2, 1, 0], [0, 0, 1]])
    assert sorted(observed.group_count) == [1, 1, 2]
    assert len(observed.local_index) == len(observed.entry_group) == 4
    decisions = apart([0, 1, 1, 0, 5, 0], [0, 0, 2, 0, 0, 7], [1, 1, 0, 9, 0, 0])
    kept = explained(minimum_example.mdp, decisions)
    np.testing.assert_array_equal(kept, [True, False, False, False, False, False])


def test_two_decisions_of_one_episode_and_time_are_rejected(gridworld):
    twice = gridworld.decisions.select([*range(10), 3])
    with pytest.raises(SerdError, match=r"got decisions\[3\] and decisions\[10\] both in episode"):
        observe(gridworld.problem, twice)
