"""Directions on the map and the actions they mean."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from serd_core.errors import SerdError
from serd_core.grid.grid import Action, action_of_direction, direction_of_action


@pytest.mark.parametrize("action", list(Action))
def test_an_action_survives_the_way_through_a_direction(action):
    assert action_of_direction(*direction_of_action(action)) == action


@given(angle=st.floats(-math.pi, math.pi), length=st.floats(0.51, 10.0))
def test_a_direction_means_an_axis_at_most_45_degrees_away(angle, length):
    east, north = length * math.cos(angle), length * math.sin(angle)
    axis = direction_of_action(action_of_direction(east, north))
    assert axis[0] * east + axis[1] * north >= length * math.cos(math.pi / 4) - 1e-9


def test_a_short_vector_means_waiting():
    assert action_of_direction(0.3, -0.3) == Action.WAIT


def test_a_direction_that_is_not_finite_is_refused_with_the_fix():
    with pytest.raises(SerdError, match=r"send \(0, 0\) to wait"):
        action_of_direction(float("nan"), 0.0)
