"""Axes and buttons to sensor_msgs/Joy."""

from collections.abc import Sequence

from sensor_msgs.msg import Joy

from serd_ros.convert.stamp import to_stamp


def to_joy(axes: Sequence[float], buttons: Sequence[int], time_s: float) -> Joy:
    """A joystick's state as joy_node publishes it."""
    message = Joy(axes=[float(axis) for axis in axes], buttons=[int(each) for each in buttons])
    message.header.stamp = to_stamp(time_s)
    return message
