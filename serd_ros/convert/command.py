"""Commands of the robot and of its driver: velocities, intents and joystick states."""

import math
from collections.abc import Sequence

from geometry_msgs.msg import Twist, TwistStamped, Vector3Stamped
from sensor_msgs.msg import Joy

from serd_core.grid.grid import Action, action_of_direction, direction_of_action
from serd_ros.convert.frames import NO_FRAMES, Frames
from serd_ros.convert.stamp import LARGEST, require_finite, require_frame, stamp_ns, to_header
from serd_ros.endpoints import topics
from serd_sim.world.command import Command


def to_twist(command: Command) -> Twist:
    """A plain Twist, what Nav2 in Jazzy and teleop_twist_keyboard send."""
    message = Twist()
    message.linear.x = float(command.linear_mps)
    message.angular.z = float(command.angular_radps)
    return message


def to_twist_stamped(command: Command, time_s: float) -> TwistStamped:
    """A TwistStamped whose stamp is that of the observation it answers."""
    return TwistStamped(header=to_header(topics.BASE_FRAME, time_s), twist=to_twist(command))


def from_twist(message: Twist) -> Command:
    """The command of a Twist; what a unicycle cannot do (linear.y, ...) is ignored.

    One beyond LARGEST becomes NaN, and one that is not finite stays so: who follows it stops.
    """
    speeds = message.linear.x, message.angular.z
    return Command(*(math.nan if abs(each) > LARGEST else each for each in speeds))


def from_twist_stamped(message: TwistStamped) -> tuple[int, Command]:
    """(stamp_ns, command); an empty frame is the robot's."""
    require_frame(message.header, topics.BASE_FRAME, "")
    return stamp_ns(message.header.stamp), from_twist(message.twist)


def from_any_twist(message: Twist | TwistStamped) -> Command:
    """The command of a message with a stamp or without."""
    is_plain = isinstance(message, Twist)
    return from_twist(message) if is_plain else from_twist_stamped(message)[1]


def to_intent(action: Action, time_s: float) -> Vector3Stamped:
    """The unit direction of an action in the map, (0, 0) to wait."""
    message = Vector3Stamped(header=to_header(topics.MAP_FRAME, time_s))
    message.vector.x, message.vector.y = direction_of_action(action)
    return message


def from_intent(message: Vector3Stamped, frames: Frames = NO_FRAMES) -> tuple[int, Action]:
    """(stamp_ns, action): the action whose axis is nearest to the direction in the map."""
    direction = message.vector.x, message.vector.y
    require_finite("vector", direction)
    if message.header.frame_id != topics.MAP_FRAME:
        matrix = frames.place(message.header.frame_id, topics.MAP_FRAME).matrix
        direction = tuple(matrix[:2, :2] @ direction)
    return stamp_ns(message.header.stamp), action_of_direction(*direction)


def to_joy(axes: Sequence[float], buttons: Sequence[int], time_s: float) -> Joy:
    """A joystick's state as joy_node publishes it."""
    values = {"axes": list(map(float, axes)), "buttons": list(map(int, buttons))}
    return Joy(header=to_header("", time_s), **values)
