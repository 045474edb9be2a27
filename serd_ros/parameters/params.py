"""From ROS parameters to one frozen config: declared once, checked once, unknown names refused."""

import json
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from pydantic import ValidationError
from rclpy.node import Node
from rclpy.parameter import Parameter

from serd_ros.errors import NodeError
from serd_ros.parameters.defaults import default_parameters
from storage.nearest import hint
from storage.validation_sentence import sentence_of
from storage.yaml_config import StrictModel

ROS_OWN = ("use_sim_time", "start_type_description_service", "qos_overrides")
Config = TypeVar("Config", bound=StrictModel)
Defaults = Callable[[Mapping[str, Any]], Mapping[str, Any]]


def read_config(
    node: Node, kind: str, config_class: type[Config], defaults_for: Defaults | None = None
) -> Config:
    """The node's parameters over the defaults of `kind`, as `config_class`.

    defaults_for: further defaults that follow from the other values, as those of a scenario.

    The node must have been made with automatically_declare_parameters_from_overrides. Raises
    NodeError with one sentence for an unknown name or a bad value.
    """
    defaults = default_parameters()[kind]
    given = _given(node)
    for name in given:
        if name not in defaults:
            raise NodeError(f"{kind} has no parameter {name!r}; {hint(name, defaults)}")
    following = defaults_for({**defaults, **given}) if defaults_for is not None else {}
    config = validated(kind, {**defaults, **following, **given}, config_class)
    for name, value in config.model_dump().items():
        if not node.has_parameter(name):
            node.declare_parameter(name, list(value) if isinstance(value, tuple) else value)
    return config


def validated(kind: str, values: dict[str, Any], config_class: type[Config]) -> Config:
    """The values as a config; NodeError names the parameter, the rule and the value."""
    try:
        return config_class.model_validate_json(json.dumps(values), strict=True)
    except ValidationError as error:
        sentence = sentence_of(error, config_class)
        raise NodeError(f"parameter of {kind}: {sentence}") from None


def _given(node: Node) -> dict[str, Any]:
    parameters: list[Parameter] = list(node.get_parameters_by_prefix("").values())
    return {
        parameter.name: _plain(parameter.value)
        for parameter in parameters
        if not parameter.name.startswith(ROS_OWN)
    }


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, (list, tuple)) or hasattr(value, "tolist") else value
