"""Velocity commands to and from geometry_msgs/Twist and TwistStamped."""

from geometry_msgs.msg import Twist, TwistStamped

from serd_ros.convert.stamp import to_stamp
from serd_ros.endpoints import topics
from sim.world.command import Command


def to_twist(command: Command) -> Twist:
    """A plain Twist, what Nav2 in Jazzy and teleop_twist_keyboard send."""
    message = Twist()
    message.linear.x = float(command.linear_mps)
    message.angular.z = float(command.angular_radps)
    return message


def to_twist_stamped(command: Command, time_s: float) -> TwistStamped:
    """A TwistStamped whose stamp is that of the observation it answers."""
    message = TwistStamped(twist=to_twist(command))
    message.header.frame_id = topics.BASE_FRAME
    message.header.stamp = to_stamp(time_s)
    return message


def from_twist(message: Twist) -> Command:
    """The command of a Twist; what a unicycle cannot do (linear.y, ...) is ignored."""
    return Command(linear_mps=message.linear.x, angular_radps=message.angular.z)
