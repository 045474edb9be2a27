"""Parameters that may change while a node runs; any other is refused, lest it is set in vain."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from serd_core.errors import SerdError
from serd_ros.parameters.params import ROS_OWN

Change = Callable[[Any], None]


def accept_changes(node: Node, changes: Mapping[str, Change]) -> None:
    """Call `changes[name](value)` when that parameter is set; a SerdError refuses the value."""

    def on_set(parameters: Sequence[Parameter]) -> SetParametersResult:
        wanted = [each for each in parameters if not each.name.startswith(ROS_OWN)]
        for parameter in wanted:
            if parameter.name not in changes:
                reason = (
                    f"{parameter.name} is fixed while the node runs; start it again with "
                    f"-p {parameter.name}:=VALUE"
                )
                return SetParametersResult(successful=False, reason=reason)
        try:
            for parameter in wanted:
                changes[parameter.name](parameter.value)
        except SerdError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    node.add_on_set_parameters_callback(on_set)
