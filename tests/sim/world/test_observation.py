"""An observation survives the way through single-precision messages bit for bit."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from serd_files.errors import USER_ERRORS
from support.observations import observation_at


@given(yaw=st.floats(-math.pi, math.pi), seed=st.integers(0, 1000))
def test_yaw_by_quaternion_and_people_by_float32_come_back_unchanged(yaw, seed):
    people, velocity = np.random.default_rng(seed).normal(size=(2, 5, 2))
    first = observation_at(1.0 / 3.0, 2.0, yaw, people=people, velocity=velocity)
    yaw = 2.0 * math.atan2(math.sin(0.5 * first.yaw_rad), math.cos(0.5 * first.yaw_rad))
    people, velocity = (each.astype(np.float32) for each in (people, velocity))
    again = observation_at(1.0 / 3.0, 2.0, yaw, people=people, velocity=velocity)
    assert again.pose == first.pose
    np.testing.assert_array_equal(again.people_position_m, first.people_position_m)
    np.testing.assert_array_equal(again.people_velocity_mps, first.people_velocity_mps)


def test_people_columns_of_different_length_are_refused():
    with pytest.raises(USER_ERRORS, match="one row per person"):
        observation_at(0.0, 0.0, people=np.zeros((2, 2)), velocity=np.zeros((3, 2)))
