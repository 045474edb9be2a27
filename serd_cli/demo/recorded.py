"""What the report shows of a recording: the robot's tracks and one moment among the people."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from serd_app.drives.recorded_drive import LONGEST_GAP_S
from serd_app.report.inputs import CrowdSnapshot
from serd_bag.messages.decoded import messages_of
from serd_ros.convert.pose import from_pose
from serd_ros.convert.sensors import from_people_message
from serd_ros.convert.stamp import stamp_ns
from serd_ros.endpoints import topics
from serd_sim.world.observation import People

_TRAIL_S = 4.0
_MOMENT = 0.45


@dataclass(frozen=True, eq=False)
class Recording:
    """Robot poses (T, 3) at times_s (T,), cut into one piece per episode."""

    times_s: tuple[NDArray[np.float64], ...]
    poses: tuple[NDArray[np.float64], ...]


def read_recording(bag: Path) -> Recording:
    """All robot poses of a bag; the clock jumps between episodes."""
    times, poses = [], []
    for _, message in messages_of(bag, [topics.ROBOT_POSE]):
        times.append(stamp_ns(message.header.stamp) * 1e-9)
        poses.append(from_pose(message.pose))
    time_s, pose = np.array(times), np.array(poses)
    time_s, first = np.unique(time_s, return_index=True)
    cuts = np.flatnonzero(np.diff(time_s) > LONGEST_GAP_S) + 1
    return Recording(tuple(np.split(time_s, cuts)), tuple(np.split(pose[first], cuts)))


def busy_moment(bag: Path, recording: Recording) -> CrowdSnapshot:
    """A moment of the middle episode, with the last seconds of everyone's way."""
    middle = len(recording.poses) // 2
    times_s, poses = recording.times_s[middle], recording.poses[middle]
    at_s = times_s[0] + _MOMENT * (times_s[-1] - times_s[0])
    people = _people_between(bag, at_s - _TRAIL_S, at_s)
    kept = [index for index, time_s in enumerate(times_s) if round(time_s * 1e9) in people]
    seen = [people[round(times_s[index] * 1e9)] for index in kept]
    return CrowdSnapshot(
        time_s=float(times_s[kept[-1]]),
        robot_pose=poses[kept[-1]],
        people_position_m=seen[-1].position_m,
        people_velocity_mps=seen[-1].velocity_mps,
        people_trail_m=np.array([each.position_m for each in seen]),
        robot_trail_m=poses[kept, :2],
    )


def _people_between(bag: Path, first_s: float, last_s: float) -> dict[int, People]:
    """People by stamp (ns) in a span of simulated time."""
    found: dict[int, People] = {}
    for _, message in messages_of(bag, [topics.PEDESTRIANS]):
        time_ns = stamp_ns(message.header.stamp)
        if first_s <= time_ns * 1e-9 <= last_s:
            _, found[time_ns] = from_people_message(message)
    return found
