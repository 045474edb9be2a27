"""What a bag says of one of its topics."""

from dataclasses import dataclass


@dataclass(frozen=True)
class TopicInfo:
    """text, type_hash: empty where the bag does not hold them; qos: YAML text as in the bag.

    encoding: of the messages, `cdr` for ROS 2; text_encoding: `ros2msg` or `ros2idl`.
    """

    name: str
    type_name: str
    text: str = ""
    type_hash: str = ""
    qos: str = ""
    encoding: str = "cdr"
    text_encoding: str = "ros2msg"
