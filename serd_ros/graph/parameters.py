"""From ROS parameters to one frozen config: declared once, checked once, unknown names rejected."""

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

from pydantic import ValidationError
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter

from serd_files.errors import USER_ERRORS
from serd_files.moved_names import where_or_near
from serd_files.settings import Setting, settings_of
from serd_files.yaml_config import sentence_of
from serd_ros.errors import NodeError
from serd_ros.graph.configs import CONFIGS, NodeConfig

ROS_OWN = ("use_sim_time", "start_type_description_service", "qos_overrides")
Config = TypeVar("Config", bound=NodeConfig)
OnSet = Callable[[Sequence[Parameter]], SetParametersResult]


def read_config(node: Node, kind: str, given: Mapping[str, Any]) -> Any:
    """What was given over the defaults, in the config of the kind; declares each parameter.

    Raises NodeError with one sentence for an unknown name or a bad value.
    """
    config_class = CONFIGS[kind]
    for name in given:
        if name not in config_class.model_fields:
            near = where_or_near("parameter", name, config_class.model_fields)
            raise NodeError(f"{kind} has no parameter {name!r}; {near}")
    config = validated(kind, given, config_class)
    for each in settings_of(config_class):
        if node.has_parameter(each.name):
            node.undeclare_parameter(each.name)
        value = getattr(config, each.name)
        descriptor = descriptor_of(each)
        descriptor.read_only = each.name not in config_class.changeable
        node.declare_parameter(each.name, plain(value), descriptor, ignore_override=True)
    return config


def validated(kind: str, given: Mapping[str, Any], config_class: type[Config]) -> Config:
    """The given values over the defaults; NodeError names the parameter, the rule and the value."""
    values = {**config_class.defaults(given), **given}
    try:
        return config_class.model_validate_json(json.dumps(values), strict=True)
    except ValidationError as error:
        sentence = sentence_of(error, config_class)
        raise NodeError(f"parameter of {kind}: {sentence}") from None


def descriptor_of(setting: Setting) -> ParameterDescriptor:
    """Description and range of a parameter, as `ros2 param describe` shows them."""
    descriptor = ParameterDescriptor(
        description=setting.description, additional_constraints=setting.range
    )
    limits = setting.limits
    low = limits.get("minimum", limits.get("exclusiveMinimum"))
    high = limits.get("maximum", limits.get("exclusiveMaximum"))
    if low is None or high is None:
        return descriptor
    if setting.schema["type"] == "integer":
        descriptor.integer_range = [IntegerRange(from_value=int(low), to_value=int(high), step=1)]
    else:
        floating = FloatingPointRange(from_value=float(low), to_value=float(high))
        descriptor.floating_point_range = [floating]
    return descriptor


def refusal_of(parameters: Sequence[Parameter], config_class: type[NodeConfig]) -> str:
    """Why parameters cannot be set while the node runs; empty where they can."""
    for name in (each.name for each in parameters):
        if name in config_class.model_fields and name not in config_class.changeable:
            return f"{name} is fixed while the node runs; start it again with -p {name}:=VALUE"
    return ""


def accept_changes(node: Node, changes: Mapping[str, Callable[[Any], None]]) -> OnSet:
    """Call `changes[name](value)` when that parameter is set; a SerdError rejects the value.

    Of two at once, the first would have changed when the second is rejected, so both are.
    Returns the callback, for `remove_on_set_parameters_callback`.
    """

    def on_set(parameters: Sequence[Parameter]) -> SetParametersResult:
        changed = [each for each in parameters if each.name in changes]
        if len(changed) > 1:
            names = " and ".join(each.name for each in changed)
            return SetParametersResult(successful=False, reason=f"set {names} one after the other")
        try:
            for parameter in changed:
                changes[parameter.name](parameter.value)
        except USER_ERRORS as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    node.add_on_set_parameters_callback(on_set)
    return on_set


def given_parameters(node: Node) -> dict[str, Any]:
    """What was given to a node with automatically_declare_parameters_from_overrides."""
    parameters: list[Parameter] = list(node.get_parameters_by_prefix("").values())
    return {
        parameter.name: plain(parameter.value)
        for parameter in parameters
        if not parameter.name.startswith(ROS_OWN)
    }


def plain(value: Any) -> Any:
    """The value of a parameter, a sequence as a list."""
    return list(value) if isinstance(value, (list, tuple)) or hasattr(value, "tolist") else value
