"""An observation survives the way through single-precision messages bit for bit."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from serd_files.errors import USER_ERRORS
from support.observations import observation_at


def observed(yaw, position, velocity):
    return observation_at(1.0 / 3.0, 2.0, yaw, people=position, velocity=velocity)


@given(yaw=st.floats(-math.pi, math.pi), seed=st.integers(0, 1000))
def test_yaw_by_quaternion_and_people_by_float32_come_back_unchanged(yaw, seed):
    rng = np.random.default_rng(seed)
    first = observed(yaw, rng.normal(size=(5, 2)), rng.normal(size=(5, 2)))
    z, w = math.sin(0.5 * first.yaw_rad), math.cos(0.5 * first.yaw_rad)
    again = observed(
        2.0 * math.atan2(z, w),
        first.people_position_m.astype(np.float32),
        first.people_velocity_mps.astype(np.float32),
    )
    assert again.pose == first.pose
    np.testing.assert_array_equal(again.people_position_m, first.people_position_m)
    np.testing.assert_array_equal(again.people_velocity_mps, first.people_velocity_mps)


def test_people_columns_of_different_length_are_refused():
    with pytest.raises(USER_ERRORS, match="one row per person"):
        observed(0.0, np.zeros((2, 2)), np.zeros((3, 2)))
