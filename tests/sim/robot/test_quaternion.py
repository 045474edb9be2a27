"""Unit quaternions against SciPy's rotations."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from serd_sim.robot.quaternion import matrix_of, of_roll_pitch_yaw


@pytest.mark.parametrize("seed", range(20))
def test_turns_are_those_of_scipy(seed):
    angles = np.random.default_rng(seed).uniform(-7.0, 7.0, 3)
    turn = of_roll_pitch_yaw(*angles.tolist())
    np.testing.assert_allclose(
        matrix_of(turn), Rotation.from_euler("xyz", angles).as_matrix(), atol=1e-15
    )
