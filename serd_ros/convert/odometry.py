"""The robot's motion to and from nav_msgs/Odometry (pose in odom, twist in base_link).

The pose is that of the wheels alone, which may drift away from the true one of `robot_pose`.
"""

from nav_msgs.msg import Odometry

from serd_ros.convert.frames import Pose
from serd_ros.convert.pose import to_pose
from serd_ros.convert.stamp import to_stamp
from serd_ros.endpoints import topics
from sim.world.observation import Observation


def to_odometry(observation: Observation, odometry_pose: Pose) -> Odometry:
    """Odometry at the observation's time. odometry_pose: (x_m, y_m, yaw_rad) in the odom frame."""
    message = Odometry()
    message.header.stamp = to_stamp(observation.time_s)
    message.header.frame_id = topics.ODOM_FRAME
    message.child_frame_id = topics.BASE_FRAME
    message.pose.pose = to_pose(odometry_pose)
    message.twist.twist.linear.x = float(observation.speed_mps)
    message.twist.twist.angular.z = float(observation.yaw_rate_radps)
    return message


def speeds_of(message: Odometry) -> tuple[float, float]:
    """(speed_mps, yaw_rate_radps) of the robot."""
    return message.twist.twist.linear.x, message.twist.twist.angular.z
