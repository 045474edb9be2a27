"""Which direction counts when a decision period begins."""

from hypothesis import given
from hypothesis import strategies as st

from serd_core.grid.grid import Action
from teleop.keyboard import DirectionChoice


def test_nothing_chosen_is_wait():
    assert DirectionChoice().decide() == Action.WAIT


def test_a_tap_counts_for_one_period_and_the_last_one_counts():
    choice = DirectionChoice()
    choice.tap(Action.NORTH)
    choice.tap(Action.EAST)
    assert choice.upcoming == Action.EAST
    assert [choice.decide(), choice.decide()] == [Action.EAST, Action.WAIT]


def test_wait_takes_a_tap_back():
    choice = DirectionChoice()
    choice.tap(Action.NORTH)
    choice.tap(Action.WAIT)
    assert choice.decide() == Action.WAIT


def test_a_held_key_counts_again_and_again_until_it_is_let_go():
    choice = DirectionChoice()
    for _ in range(3):
        choice.hold(Action.NORTH)
        assert choice.decide() == Action.NORTH
    choice.hold(Action.NORTH)
    choice.hold(None)
    assert choice.decide() == Action.WAIT


def test_a_key_let_go_before_the_period_still_counts_once():
    choice = DirectionChoice()
    choice.hold(Action.WEST)
    choice.hold(None)
    assert [choice.decide(), choice.decide()] == [Action.WEST, Action.WAIT]


presses = st.lists(
    st.tuples(st.sampled_from(["tap", "hold"]), st.sampled_from([*Action, None])), max_size=20
)


@given(presses)
def test_after_clear_nobody_drives_whatever_was_pressed(pressed):
    choice = DirectionChoice()
    for kind, action in pressed:
        if kind == "hold":
            choice.hold(action)
        elif action is not None:
            choice.tap(action)
    choice.clear()
    assert choice.decide() == Action.WAIT
