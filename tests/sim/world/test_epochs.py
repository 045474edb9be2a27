"""When decisions end and begin, and what they led to."""

import numpy as np
import pytest

from serd_core.grid.grid import Action, Grid
from serd_sim.world.epochs import LEAST_DWELL_S, DecisionEpochs, decisions_of

#: Row 1 has a wall in its third column.
GRID = Grid((0.0, 0.0), 1.0, np.array([[1, 1, 1, 1], [1, 1, 0, 1], [1, 1, 1, 1]], bool))
NORTH, EAST, WAIT = Action.NORTH, Action.EAST, Action.WAIT
A, B, C, UP, MIDDLE, RIGHT = (
    int(GRID.state_of_cell[row, column])
    for column, row in ((0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (3, 1))
)
IN_A, IN_MIDDLE = (0.5, 0.5), (1.5, 1.5)


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


def ended(epochs):
    """(state, next state, begin, end) of each epoch, with "censored" where it is."""
    return [
        (each.state, each.next_state, round(each.begin_s, 6), round(each.end_s, 6))
        + ("censored",) * each.censored
        for each in epochs.ended
    ]


def line(start, end, n=41):
    return np.linspace(start, end, n)


ONE_CELL_ON = line(IN_A, (2.5, 0.5))


@pytest.mark.parametrize(
    ("places", "action", "step_s", "expected"),
    [
        # Each border counts a tenth of a cell beyond it, at 0.5 m/s.
        (ONE_CELL_ON, EAST, 0.1, [(A, B, 0.0, 1.2), (B, C, 1.2, 3.2)]),
        ([IN_A, (1.5, 0.5)], EAST, 1.0, [(A, B, 0.0, 0.6)]),
        # A fast diagonal passage is two crossings of one action.
        ([(0.5, 0.6), (1.5, 1.6)], NORTH, 0.5, [(A, UP, 0.0, 0.25), (UP, MIDDLE, 0.25, 0.3)]),
        # Patience ends a move that leads nowhere; a wait has its own length unless the robot rolls.
        ([IN_MIDDLE] * 101, EAST, 0.1, [(MIDDLE, MIDDLE, 0.0, 4.0), (MIDDLE, MIDDLE, 4.0, 8.0)]),
        ([IN_MIDDLE] * 25, WAIT, 0.1, [(MIDDLE, MIDDLE, 0.0, 1.0), (MIDDLE, MIDDLE, 1.0, 2.0)]),
        ([(0.9, 0.5), (1.05, 0.5), (1.2, 0.5)], WAIT, 0.1, [(A, B, 0.0, 0.133333)]),
    ],
)
def test_an_epoch_ends_where_another_cell_is_entered_or_patience_ends(
    epochs, places, action, step_s, expected
):
    drive(epochs, places, action, step_s)
    assert ended(epochs) == expected
    assert {each.action for each in epochs.ended} == {action}


@pytest.mark.parametrize(
    ("places", "action", "end", "expected"),
    [
        # A goal counts as entered at its border, and a timeout censors.
        ([IN_A, (0.9, 0.5)], EAST, (0.2, 1.01, 0.5, True), [(A, B, 0.0, 0.2)]),
        ([IN_A, (0.9, 0.5)], EAST, (0.2, 1.01, 0.5, False), [(A, A, 0.0, 0.2, "censored")]),
        ([IN_A, (0.9, 0.5)], EAST, (0.2, 1.4, 0.5, True), [(A, B, 0.0, 0.2)]),
        # Also where patience runs out just then.
        ([IN_A, (0.98, 0.5)], EAST, (4.0, 1.01, 0.5, True), [(A, B, 0.0, 4.0)]),
        ([IN_A, (0.98, 0.5)], WAIT, (1.0, 1.01, 0.5, True), [(A, B, 0.0, 1.0)]),
        ([IN_A], EAST, (4.0, 0.6, 0.5, True), [(A, A, 0.0, 4.0, "censored")]),
        # Across a corner it is reached by two crossings.
        ([IN_A, (0.95, 0.95)], EAST, (0.2, 1.02, 1.05, True),
         [(A, UP, 0.0, 0.2), (UP, MIDDLE, 0.2, 0.2)]),
        ([IN_A, (0.95, 0.95)], EAST, (0.2, 1.05, 1.02, True),
         [(A, B, 0.0, 0.2), (B, MIDDLE, 0.2, 0.2)]),
        ([IN_A, (0.5, 0.95), (0.95, 1.05)], NORTH, (0.3, 1.02, 1.3, True),
         [(A, UP, 0.0, 0.22), (UP, MIDDLE, 0.22, 0.3)]),
    ],
)  # fmt: skip
def test_the_end_of_an_episode_ends_its_epoch_in_the_goal_or_censors_it(
    epochs, places, action, end, expected
):
    drive(epochs, places, action)
    *place, arrived = end
    epochs.end(*place, arrived=arrived)
    assert [(*row[:2], *row[4:]) for row in ended(epochs)] == [
        (*row[:2], *row[4:]) for row in expected
    ]
    assert epochs.ended[-1].end_s == pytest.approx(expected[-1][3])


def test_a_robot_that_sways_on_a_border_decides_no_more_than_one_in_the_cell(epochs):
    time_s = np.arange(39) * 0.1
    swaying = np.stack([1.0 + 0.08 * np.sin(9 * time_s), np.full(39, 0.5)], axis=1)
    assert drive(epochs, [IN_A, *swaying], NORTH) == [0.0]
    assert drive(epochs, [(1.12, 0.5), *swaying[:30]], NORTH, begin_s=4.0) == [4.0]


def test_what_another_command_interrupts_is_censored_and_credited_to_neither(epochs):
    epochs.see(0.0, *IN_A)
    epochs.take(0.0, NORTH)
    assert not epochs.see(1.5, *IN_A)
    epochs.take(1.5, EAST)
    drive(epochs, line(IN_A, (1.5, 0.5), 6), EAST, begin_s=1.6)
    assert ended(epochs) == [(A, A, 0.0, 1.5, "censored"), (A, B, 1.5, 1.9)]
    assert [each.action for each in epochs.ended] == [NORTH, EAST]
    epochs.interrupt(9.0)
    epochs.interrupt(9.5)
    assert [each.censored for each in epochs.ended] == [True, False, True]
    assert epochs.see(9.6, 1.5, 0.5), "after an interruption the next place begins an epoch"


def test_a_place_that_comes_again_begins_its_epoch_again_and_ends_none_twice(epochs):
    for action in (NORTH, EAST):
        assert epochs.see(0.0, *IN_A)
        epochs.take(0.0, action)
    assert epochs.ended == []
    for action in (EAST, NORTH, EAST):
        assert epochs.see(1.0, 1.2, 0.5)
        epochs.take(1.0, action)
    for _ in range(3):
        assert not epochs.see(1.1, 1.2, 0.5)
    assert len(epochs.ended) == 1


def test_decisions_outside_the_grid_or_past_a_wall_are_left_out(epochs):
    places = [*line((-1.5, 0.5), IN_A, 11), *line(IN_A, (-1.5, 0.5), 11)]
    assert drive(epochs, places, EAST) == [0.0, 0.8, 1.9], "an entry begins one"
    assert len(decisions_of({7: epochs.ended}, "test")) == 0
    assert [each.next_state for each in epochs.ended] == [A, -1]
    epochs.begin()
    drive(epochs, line(IN_MIDDLE, (3.5, 1.5), 21), EAST)
    assert (epochs.ended, epochs.n_lost, epochs.state) == ([], 1, RIGHT)


def test_decisions_of_episodes_have_their_dwell_times(epochs):
    drive(epochs, [IN_A, (1.5, 1.5001)], NORTH, step_s=0.5)
    drive(epochs, [IN_MIDDLE] * 41, EAST, begin_s=0.5)
    found = decisions_of({3: epochs.ended, 4: epochs.ended[:1]}, "a source")
    assert found.episode.tolist() == [3, 3, 3, 4]
    assert found.action.tolist() == [NORTH, NORTH, EAST, NORTH]
    assert found.time_s.tolist() == pytest.approx([0.0, 0.3, 0.3 + LEAST_DWELL_S, 0.0], abs=1e-3)
    assert found.dwell_s[:2].tolist() == pytest.approx([0.3, LEAST_DWELL_S], abs=1e-3)
    assert 4.0 <= found.dwell_s[2] < 4.1, "it ends at the first place after its patience"
    assert not found.censored.any()
    assert found.source == "a source"
