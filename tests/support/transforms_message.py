"""Messages of /tf in CDR: there is no wheel of tf2_msgs."""

import math

from serd_bag.formats.rosbag2.message_types import rosbags_types
from serd_ros.endpoints.topic_types import TF_TYPE


def quaternion(yaw):
    """(z, w) of a turn."""
    return math.sin(yaw / 2), math.cos(yaw / 2)


def transforms_message(*placed):
    """A TFMessage in CDR of (parent, child, (x, y) m, (z, w) of the quaternion, time_s)."""
    types = rosbags_types().types
    made = [
        types["geometry_msgs/msg/TransformStamped"](
            types["std_msgs/msg/Header"](
                types["builtin_interfaces/msg/Time"](*divmod(round(time_s * 1e9), 10**9)), parent
            ),
            child,
            types["geometry_msgs/msg/Transform"](
                types["geometry_msgs/msg/Vector3"](*place_m, 0.0),
                types["geometry_msgs/msg/Quaternion"](0.0, 0.0, *turn),
            ),
        )
        for parent, child, place_m, turn, time_s in placed
    ]
    return bytes(rosbags_types().serialize_cdr(types[TF_TYPE](made), TF_TYPE))
