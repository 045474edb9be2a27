"""Snapshots cut the right moment and trail out of a history."""

import numpy as np
import pytest

from serd_app.report.inputs import snapshot_from_history
from serd_core.errors import SerdError

TIMES = np.arange(0.0, 10.0, 0.5)
HISTORY = {
    "times_s": TIMES,
    "robot_pose": np.stack([TIMES, 2 * TIMES, 0 * TIMES], axis=1),
    "people_position_m": np.stack([np.stack([TIMES, -TIMES], axis=1)] * 2, axis=1),
    "people_velocity_mps": np.ones((len(TIMES), 2, 2)),
}


def test_the_moment_is_the_last_one_not_later_than_asked():
    snapshot = snapshot_from_history(**HISTORY, at_s=6.2, trail_s=2.0)
    assert snapshot.time_s == 6.0
    assert snapshot.robot_pose.tolist() == [6.0, 12.0, 0.0]
    assert snapshot.robot_trail_m[:, 0].tolist() == [4.0, 4.5, 5.0, 5.5, 6.0]
    assert snapshot.people_trail_m.shape == (5, 2, 2)
    np.testing.assert_array_equal(snapshot.people_trail_m[-1], snapshot.people_position_m)


def test_a_moment_before_the_recording_is_refused():
    with pytest.raises(SerdError, match="at_s must not lie before the first recorded time"):
        snapshot_from_history(**HISTORY, at_s=-1.0)
