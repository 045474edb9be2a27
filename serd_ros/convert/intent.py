"""Intended directions to and from geometry_msgs/Vector3Stamped."""

from geometry_msgs.msg import Vector3Stamped

from serd_core.grid.grid import Action, action_of_direction, direction_of_action
from serd_ros.convert.stamp import to_stamp
from serd_ros.endpoints import topics


def to_intent(action: Action, time_s: float) -> Vector3Stamped:
    """The unit direction of an action in the map, (0, 0) to wait."""
    message = Vector3Stamped()
    message.header.frame_id = topics.MAP_FRAME
    message.header.stamp = to_stamp(time_s)
    message.vector.x, message.vector.y = direction_of_action(action)
    return message


def from_intent(message: Vector3Stamped) -> Action:
    """The action a direction means: the nearest axis."""
    return action_of_direction(message.vector.x, message.vector.y)
