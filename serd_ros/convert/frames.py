"""Poses in the plane as transforms between frames (REP 105): map -> odom -> base_link."""

import math

from geometry_msgs.msg import TransformStamped

from serd_ros.convert.pose import to_quaternion
from serd_ros.convert.stamp import to_stamp

Pose = tuple[float, float, float]


def to_transform(parent: str, child: str, pose: Pose, time_s: float) -> TransformStamped:
    """The frame `child` lies at (x_m, y_m, yaw_rad) in `parent`."""
    message = TransformStamped()
    message.header.frame_id, message.header.stamp = parent, to_stamp(time_s)
    message.child_frame_id = child
    message.transform.translation.x = float(pose[0])
    message.transform.translation.y = float(pose[1])
    message.transform.rotation = to_quaternion(pose[2])
    return message


def odom_in_map(base_in_map: Pose, base_in_odom: Pose) -> Pose:
    """Where the odometry's frame lies, T_map_odom = T_map_base T_odom_base^-1."""
    yaw = base_in_map[2] - base_in_odom[2]
    x_m, y_m = base_in_odom[0], base_in_odom[1]
    return (
        base_in_map[0] - (math.cos(yaw) * x_m - math.sin(yaw) * y_m),
        base_in_map[1] - (math.sin(yaw) * x_m + math.cos(yaw) * y_m),
        math.atan2(math.sin(yaw), math.cos(yaw)),
    )
