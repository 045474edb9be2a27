"""Which direction a person wants who holds keys."""

from hypothesis import given
from hypothesis import strategies as st

from serd_app.teleop.direction_choice import DirectionChoice
from serd_core.grid.grid import Action
from serd_sim.drivers.expert import MOVES

HELD = st.lists(st.sampled_from([*MOVES, None]), max_size=20)


def test_nothing_held_is_to_wait():
    assert DirectionChoice().action == Action.WAIT


@given(HELD)
def test_a_direction_counts_while_it_is_held(held):
    choice = DirectionChoice()
    for action in held:
        choice.hold(action)
        assert choice.action == (Action.WAIT if action is None else action)


@given(HELD)
def test_after_clear_the_choice_is_to_wait_until_a_key_is_pressed_anew(held):
    choice = DirectionChoice()
    for action in held:
        choice.hold(action)
    choice.clear()
    choice.hold(Action.NORTH)
    choice.hold(Action.EAST)
    assert choice.action == Action.WAIT
    choice.hold(None)
    choice.hold(Action.EAST)
    assert choice.action == Action.EAST


def test_a_key_that_is_held_from_the_start_on_counts():
    choice = DirectionChoice()
    choice.hold(Action.NORTH)
    assert choice.action == Action.NORTH
