"""One recorded moment of the hallway with the last few seconds of everybody's path."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from report.checks import array_with_gaps, finite_number
from report.errors import ReportError
from serd_core.arrays import FloatArray, float_array


@dataclass(frozen=True, eq=False)
class CrowdSnapshot:
    """Who was where at `time_s`; trails run from oldest to newest.

    robot_pose (3,) x_m, y_m, yaw_rad; people_position_m (N, 2); people_velocity_mps (N, 2);
    people_trail_m (T, N, 2), NaN where a person was not seen yet; robot_trail_m (T, 2).
    """

    time_s: float
    robot_pose: FloatArray
    people_position_m: FloatArray
    people_velocity_mps: FloatArray
    people_trail_m: FloatArray
    robot_trail_m: FloatArray

    def __post_init__(self) -> None:
        people = len(self.people_position_m)
        finite_number("time_s of the snapshot", self.time_s)
        shapes: dict[str, tuple[int | None, ...]] = {
            "robot_pose": (3,),
            "people_position_m": (people, 2),
            "people_velocity_mps": (people, 2),
            "robot_trail_m": (None, 2),
        }
        for name, shape in shapes.items():
            object.__setattr__(self, name, float_array(name, getattr(self, name), shape))
        trail = array_with_gaps("people_trail_m", self.people_trail_m, (None, people, 2))
        object.__setattr__(self, "people_trail_m", trail)


def snapshot_from_history(
    *,
    times_s: Any,
    robot_pose: Any,
    people_position_m: Any,
    people_velocity_mps: Any,
    at_s: float,
    trail_s: float = 4.0,
) -> CrowdSnapshot:
    """The last recorded moment not later than `at_s`, with the `trail_s` seconds before it.

    times_s (T,) increasing; robot_pose (T, 3); people_position_m and people_velocity_mps (T, N, 2).
    """
    times = float_array("times_s", times_s, (None,))
    last = int(np.searchsorted(times, at_s, side="right")) - 1
    if last < 0:
        raise ReportError(
            f"at_s must not lie before the first recorded time, got {at_s} s; choose a later moment"
        )
    first = int(np.searchsorted(times, times[last] - trail_s, side="left"))
    positions, poses = np.asarray(people_position_m), np.asarray(robot_pose)
    return CrowdSnapshot(
        time_s=float(times[last]),
        robot_pose=poses[last],
        people_position_m=positions[last],
        people_velocity_mps=np.asarray(people_velocity_mps)[last],
        people_trail_m=positions[first : last + 1],
        robot_trail_m=poses[first : last + 1, :2],
    )
