"""Which direction counts when a decision period begins."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from serd_app.teleop.direction_choice import DirectionChoice
from serd_core.grid.grid import Action


def test_nothing_chosen_is_wait():
    assert DirectionChoice().decide() == Action.WAIT


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
    for action in (Action.NORTH, Action.WEST, None):
        choice.hold(action)
    assert choice.upcoming == Action.WEST
    assert [choice.decide(), choice.decide()] == [Action.WEST, Action.WAIT]


def test_wait_takes_a_key_back_that_was_released(choice):
    for action in (Action.WEST, None, Action.WAIT, None):
        choice.hold(action)
    assert choice.decide() == Action.WAIT


@given(st.lists(st.sampled_from([*Action, None]), max_size=20))
def test_after_clear_the_choice_is_wait_until_a_key_is_pressed_anew(held):
    choice = DirectionChoice()
    for action in held:
        choice.hold(action)
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
