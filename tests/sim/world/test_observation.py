"""An observation survives the way through single-precision messages bit for bit."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from serd_core.errors import SerdError
from sim.world.observation import make_observation


def observed(yaw, position, velocity):
    return make_observation(
        time_s=1.0,
        tick=20,
        pose=(1.0 / 3.0, 2.0, yaw),
        speed_mps=0.1,
        yaw_rate_radps=0.2,
        people_position_m=position,
        people_velocity_mps=velocity,
        people_id=np.arange(len(position)),
    )


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
    with pytest.raises(SerdError, match="one row per person"):
        observed(0.0, np.zeros((2, 2)), np.zeros((3, 2)))
