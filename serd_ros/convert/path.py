"""Points to nav_msgs/Path."""

import numpy as np
from nav_msgs.msg import Path
from numpy.typing import NDArray

from serd_ros.convert.pose import to_pose_stamped
from serd_ros.convert.stamp import to_stamp
from serd_ros.endpoints import topics


def to_path(points_m: NDArray[np.float64], time_s: float) -> Path:
    """(N, 2) points in the map as a path; each pose looks along its next leg."""
    legs = np.diff(points_m, axis=0, append=points_m[-1:]) if len(points_m) else points_m
    yaws = np.arctan2(legs[:, 1], legs[:, 0]) if len(points_m) else np.zeros(0)
    message = Path()
    message.header.frame_id = topics.MAP_FRAME
    message.header.stamp = to_stamp(time_s)
    message.poses = [
        to_pose_stamped((x, y, yaw), time_s) for (x, y), yaw in zip(points_m, yaws, strict=True)
    ]
    return message
