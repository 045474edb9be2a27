"""When decisions end and begin, and what they led to."""

import numpy as np
import pytest

from serd_core.grid.grid import Action, Grid
from serd_sim.world.epochs import LEAST_DWELL_S, DecisionEpochs, Epoch, decisions_of

#: Row 1 has a wall in its third column.
GRID = Grid((0.0, 0.0), 1.0, np.array([[1, 1, 1, 1], [1, 1, 0, 1], [1, 1, 1, 1]], bool))
NORTH, EAST, WAIT = Action.NORTH, Action.EAST, Action.WAIT


def state(column, row):
    return int(GRID.state_of_cell[row, column])


@pytest.fixture
def epochs():
    return DecisionEpochs(GRID, patience_s=4.0, wait_s=1.0)


def drive(epochs, places, action, step_s=0.1, begin_s=0.0):
    """Decide for the action wherever an epoch begins; the times at which one did."""
    began = []
    for number, place in enumerate(places):
        time_s = begin_s + number * step_s
        if epochs.see(time_s, *place):
            epochs.take(time_s, action)
            began.append(round(time_s, 6))
    return began


def line(start, end, n=41):
    return np.linspace(start, end, n)


def test_an_epoch_ends_where_another_cell_is_entered_and_the_next_one_begins_there(epochs):
    drive(epochs, line((0.5, 0.5), (2.5, 0.5)), EAST)
    # Each border counts a tenth of a cell beyond it, at 0.5 m/s.
    assert epochs.ended == [
        Epoch(state(0, 0), EAST, 0.0, pytest.approx(1.2), state(1, 0)),
        Epoch(state(1, 0), EAST, pytest.approx(1.2), pytest.approx(3.2), state(2, 0)),
    ]
    assert (epochs.state, epochs.action) == (state(2, 0), EAST)


def test_a_crossing_is_dated_between_two_observations(epochs):
    drive(epochs, [(0.5, 0.5), (1.5, 0.5)], EAST, step_s=1.0)
    assert epochs.ended[0].end_s == pytest.approx(0.6)
    epochs.take(1.0, NORTH)
    epochs.see(2.0, 1.5, 1.5)
    assert epochs.ended[-1].begin_s == pytest.approx(0.6)


def test_a_robot_that_sways_on_a_border_decides_no_more_than_one_in_the_cell(epochs):
    time_s = np.arange(39) * 0.1
    swaying = np.stack([1.0 + 0.08 * np.sin(9 * time_s), np.full(39, 0.5)], axis=1)
    assert drive(epochs, [(0.5, 0.5), *swaying], NORTH) == [0.0]
    assert drive(epochs, [(1.12, 0.5), *swaying[:30]], NORTH, begin_s=4.0) == [4.0]


def test_a_fast_diagonal_passage_is_two_crossings_of_one_action(epochs):
    drive(epochs, [(0.5, 0.6), (1.5, 1.6)], NORTH, step_s=0.5)
    assert [(each.state, each.next_state) for each in epochs.ended] == [
        (state(0, 0), state(0, 1)),
        (state(0, 1), state(1, 1)),
    ]
    assert {each.action for each in epochs.ended} == {NORTH}
    assert not any(each.censored for each in epochs.ended)


def test_patience_ends_a_move_that_leads_nowhere_with_the_outcome_to_stay(epochs):
    assert drive(epochs, [(1.5, 1.5)] * 101, EAST) == [0.0, 4.0, 8.0]
    assert epochs.ended == [
        Epoch(state(1, 1), EAST, pytest.approx(begin_s), pytest.approx(begin_s + 4), state(1, 1))
        for begin_s in (0.0, 4.0)
    ]


def test_a_decision_to_wait_has_its_own_length_unless_the_robot_rolls_on(epochs):
    assert drive(epochs, [(1.5, 1.5)] * 25, WAIT) == [0.0, 1.0, 2.0]
    epochs.begin()
    drive(epochs, [(0.9, 0.5), (1.05, 0.5), (1.2, 0.5)], WAIT)
    (rolled,) = epochs.ended
    assert (rolled.state, rolled.next_state) == (state(0, 0), state(1, 0))


def test_what_another_command_interrupts_is_censored_and_credited_to_neither(epochs):
    epochs.see(0.0, 0.5, 0.5)
    epochs.take(0.0, NORTH)
    assert not epochs.see(1.5, 0.5, 0.5)
    epochs.take(1.5, EAST)
    drive(epochs, line((0.5, 0.5), (1.5, 0.5), 6), EAST, begin_s=1.6)
    assert epochs.ended == [
        Epoch(state(0, 0), NORTH, 0.0, 1.5, state(0, 0), censored=True),
        Epoch(state(0, 0), EAST, 1.5, pytest.approx(1.9), state(1, 0)),
    ]
    epochs.interrupt(9.0)
    epochs.interrupt(9.5)
    assert [each.censored for each in epochs.ended] == [True, False, True]
    assert epochs.see(9.6, 1.5, 0.5), "after an interruption the next place begins an epoch"


def test_a_place_that_comes_again_begins_its_epoch_again_and_ends_none_twice(epochs):
    for _ in range(2):
        assert epochs.see(0.0, 0.5, 0.5)
    epochs.take(0.0, NORTH)
    epochs.take(0.0, EAST)
    assert epochs.see(0.0, 0.5, 0.5)
    assert epochs.ended == []
    for action in (EAST, NORTH, EAST):
        assert epochs.see(1.0, 1.2, 0.5)
        epochs.take(1.0, action)
    for _ in range(3):
        assert not epochs.see(1.1, 1.2, 0.5)
    assert len(epochs.ended) == 1


@pytest.mark.parametrize(
    ("arrived", "next_state", "censored"),
    [(True, state(1, 0), False), (False, state(0, 0), True)],
)
def test_a_goal_counts_as_entered_at_its_border_and_a_timeout_censors(
    epochs, arrived, next_state, censored
):
    drive(epochs, [(0.5, 0.5), (0.9, 0.5)], EAST)
    epochs.end(0.2, 1.01, 0.5, arrived=arrived)
    assert epochs.ended == [Epoch(state(0, 0), EAST, 0.0, 0.2, next_state, censored=censored)]


@pytest.mark.parametrize(
    ("goal", "between"), [((1.02, 1.05), state(0, 1)), ((1.05, 1.02), state(1, 0))]
)
def test_a_goal_that_is_entered_across_a_corner_is_reached_by_two_crossings(epochs, goal, between):
    drive(epochs, [(0.5, 0.5), (0.95, 0.95)], EAST)
    epochs.end(0.2, *goal, arrived=True)
    assert [(each.state, each.next_state, each.censored) for each in epochs.ended] == [
        (state(0, 0), between, False),
        (between, state(1, 1), False),
    ]


def test_a_goal_behind_a_corner_is_reached_when_one_border_was_crossed_far_enough(epochs):
    drive(epochs, [(0.5, 0.5), (0.5, 0.95), (0.95, 1.05)], NORTH)
    epochs.end(0.3, 1.02, 1.3, arrived=True)
    assert [each.next_state for each in epochs.ended] == [state(0, 1), state(1, 1)]


@pytest.mark.parametrize(("action", "end_s"), [(EAST, 4.0), (WAIT, 1.0)])
def test_a_goal_that_is_reached_when_patience_runs_out_is_reached(epochs, action, end_s):
    drive(epochs, [(0.5, 0.5), (0.98, 0.5)], action)
    epochs.end(end_s, 1.01, 0.5, arrived=True)
    assert [(each.next_state, each.censored) for each in epochs.ended] == [(state(1, 0), False)]
    epochs.begin()
    drive(epochs, [(0.5, 0.5)], action)
    epochs.end(end_s, 0.6, 0.5, arrived=True)
    assert epochs.ended == [Epoch(state(0, 0), action, 0.0, end_s, state(0, 0), censored=True)]


def test_a_drive_that_ends_with_a_crossing_has_it_once(epochs):
    drive(epochs, [(0.5, 0.5), (0.9, 0.5)], EAST)
    epochs.end(0.2, 1.4, 0.5, arrived=True)
    assert [each.next_state for each in epochs.ended] == [state(1, 0)]


def test_decisions_outside_the_grid_are_left_out_and_an_entry_begins_one(epochs):
    places = [*line((-1.5, 0.5), (0.5, 0.5), 11), *line((0.5, 0.5), (-1.5, 0.5), 11)]
    began = drive(epochs, places, EAST)
    assert began == [0.0, 0.8, 1.9]
    found = decisions_of({7: epochs.ended}, "test")
    assert len(found) == 0
    assert [each.next_state for each in epochs.ended] == [state(0, 0), -1]


def test_a_cell_that_was_reached_past_a_wall_is_entered_and_its_decision_is_lost(epochs):
    drive(epochs, line((1.5, 1.5), (3.5, 1.5), 21), EAST)
    assert (epochs.ended, epochs.n_lost) == ([], 1)
    assert epochs.state == state(3, 1)


def test_a_new_drive_has_nothing_of_the_last_one(epochs):
    drive(epochs, line((0.5, 0.5), (2.5, 0.5)), EAST)
    epochs.begin()
    assert epochs.ended == []
    assert epochs.see(4.0, 2.5, 0.5), "also at the time of the last place"
    epochs.take(4.0, EAST)
    epochs.see(5.0, 3.5, 0.5)
    assert epochs.ended == [Epoch(state(2, 0), EAST, 4.0, pytest.approx(4.6), state(3, 0))]


def test_decisions_of_episodes_have_their_dwell_times(epochs):
    drive(epochs, [(0.5, 0.5), (1.5, 1.5001)], NORTH, step_s=0.5)
    drive(epochs, [(1.5, 1.5)] * 41, EAST, begin_s=0.5)
    found = decisions_of({3: epochs.ended, 4: epochs.ended[:1]}, "a source")
    assert found.episode.tolist() == [3, 3, 3, 4]
    assert found.action.tolist() == [NORTH, NORTH, EAST, NORTH]
    assert found.time_s.tolist() == pytest.approx([0.0, 0.3, 0.3 + LEAST_DWELL_S, 0.0], abs=1e-3)
    assert found.dwell_s[:2].tolist() == pytest.approx([0.3, LEAST_DWELL_S], abs=1e-3)
    assert 4.0 <= found.dwell_s[2] < 4.1, "it ends at the first place after its patience"
    assert found.censored.tolist() == [False] * 4
    assert found.source == "a source"
