"""Which direction counts when a decision period begins."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from serd_app.teleop.keyboard import DirectionChoice
from serd_core.grid.grid import Action


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


@pytest.fixture
def choice():
    """Nothing is held."""
    choice = DirectionChoice()
    choice.hold(None)
    return choice


def test_a_held_key_counts_in_each_period_until_it_is_released(choice):
    for _ in range(3):
        choice.hold(Action.NORTH)
        assert choice.decide() == Action.NORTH
    choice.hold(Action.NORTH)
    choice.hold(None)
    assert choice.decide() == Action.WAIT


def test_a_key_released_before_the_period_counts_once(choice):
    choice.hold(Action.WEST)
    choice.hold(None)
    assert [choice.decide(), choice.decide()] == [Action.WEST, Action.WAIT]


presses = st.lists(
    st.tuples(st.sampled_from(["tap", "hold"]), st.sampled_from([*Action, None])), max_size=20
)


@given(presses)
def test_after_clear_the_choice_is_wait_until_a_key_is_pressed_anew(pressed):
    choice = DirectionChoice()
    for kind, action in pressed:
        if kind == "hold":
            choice.hold(action)
        elif action is not None:
            choice.tap(action)
    choice.clear()
    choice.hold(Action.NORTH)
    choice.hold(Action.EAST)
    assert choice.decide() == Action.WAIT
    choice.hold(None)
    choice.hold(Action.EAST)
    assert choice.decide() == Action.EAST


def test_a_key_that_is_held_at_the_start_counts_after_its_release():
    choice = DirectionChoice()
    choice.hold(Action.NORTH)
    assert choice.decide() == Action.WAIT
