"""Messages of /tf in CDR: there is no wheel of tf2_msgs."""

from serd_bag.formats.rosbag2.message_types import rosbags_types
from serd_ros.endpoints.transforms import TF_TYPE


def transforms_message(*placed):
    """A TFMessage in CDR of (parent, child, x_m, w of the quaternion)."""
    types = rosbags_types().types
    made = [
        types["geometry_msgs/msg/TransformStamped"](
            types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](1, 0), parent),
            child,
            types["geometry_msgs/msg/Transform"](
                types["geometry_msgs/msg/Vector3"](x_m, 0.0, 0.0),
                types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, w),
            ),
        )
        for parent, child, x_m, w in placed
    ]
    return bytes(rosbags_types().serialize_cdr(types[TF_TYPE](made), TF_TYPE))
