"""(x, y, yaw) to and from geometry_msgs/PoseStamped; yaw is a rotation about z (REP 103)."""

import math

from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion

from serd_ros.convert.stamp import to_stamp
from serd_ros.endpoints import topics
from sim.world.waypoint import Waypoint


def to_quaternion(yaw_rad: float) -> Quaternion:
    """Rotation by `yaw_rad` about the vertical."""
    return Quaternion(x=0.0, y=0.0, z=math.sin(yaw_rad / 2), w=math.cos(yaw_rad / 2))


def yaw_of(quaternion: Quaternion) -> float:
    """Yaw (rad, in [-pi, pi]) of a rotation; roll and pitch are ignored."""
    x, y, z, w = quaternion.x, quaternion.y, quaternion.z, quaternion.w
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def to_pose(pose: tuple[float, float, float]) -> Pose:
    """(x_m, y_m, yaw_rad) as a geometry_msgs/Pose."""
    x_m, y_m, yaw_rad = pose
    return Pose(
        position=Point(x=float(x_m), y=float(y_m), z=0.0), orientation=to_quaternion(yaw_rad)
    )


def from_pose(message: Pose) -> tuple[float, float, float]:
    """(x_m, y_m, yaw_rad) of a geometry_msgs/Pose."""
    return message.position.x, message.position.y, yaw_of(message.orientation)


def to_pose_stamped(pose: tuple[float, float, float], time_s: float) -> PoseStamped:
    """A pose in the map at a time."""
    message = PoseStamped(pose=to_pose(pose))
    message.header.frame_id = topics.MAP_FRAME
    message.header.stamp = to_stamp(time_s)
    return message


def to_waypoint_message(waypoint: Waypoint, time_s: float) -> PoseStamped:
    """A waypoint in the map, stamped with the decision it belongs to."""
    return to_pose_stamped((waypoint.x_m, waypoint.y_m, 0.0), time_s)


def from_waypoint_message(message: PoseStamped) -> Waypoint:
    """The waypoint a message names."""
    return Waypoint(x_m=message.pose.position.x, y_m=message.pose.position.y)
