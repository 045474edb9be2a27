"""From ROS parameters to one frozen config: declared once, checked once, unknown names rejected."""

import json
from collections.abc import Collection, Mapping, Sequence
from typing import Any, Generic

from pydantic import ValidationError
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
)
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.node import Node
from rclpy.parameter import Parameter

from serd_files.errors import USER_ERRORS
from serd_files.moved_names import where_or_near
from serd_files.settings import Setting, settings_of
from serd_files.yaml_config import sentence_of
from serd_ros.errors import NodeError
from serd_ros.settings import Config

_MANAGED = "managed"
ROS_OWN = ("use_sim_time", "start_type_description_service", "qos_overrides")


class FixedParameterError(ParameterNotDeclaredException):
    """Raised before a parameter is set that cannot be set now.

    rclpy's parameter services answer with its sentence; their own for a read-only parameter has no
    fix.
    """

    def __init__(self, sentence: str) -> None:
        Exception.__init__(self, sentence)


class Parameters(Generic[Config]):
    """The parameters of a node, each declared once, in one frozen config.

    While a managed node is unconfigured all but `managed` can be set, which changes the defaults
    that depend on them; of any other node those that its config names as changeable.
    """

    def __init__(self, node: Node, kind: str, config_class: type[Config]) -> None:
        self._node, self._kind, self._class = node, kind, config_class
        self._state = ""
        #: With automatically_declare_parameters_from_overrides.
        self._given = {
            each.name: plain(each.value)
            for each in node.get_parameters_by_prefix("").values()
            if not each.name.startswith(ROS_OWN)
        }
        #: What will be given, and the config, once the callback that sets parameters has returned.
        self._chosen: tuple[dict[str, Any], Config] | None = None
        for name in self._given:
            if name not in config_class.model_fields:
                near = where_or_near("parameter", name, config_class.model_fields)
                raise NodeError(f"{kind} has no parameter {name!r}; {near}")
        self.config = validated(kind, self._given, config_class)
        for each in settings_of(config_class):
            if node.has_parameter(each.name):
                node.undeclare_parameter(each.name)
            value, descriptor = plain(getattr(self.config, each.name)), descriptor_of(each)
            descriptor.read_only = each.name not in config_class.changeable
            node.declare_parameter(each.name, value, descriptor, ignore_override=True)
        node.add_pre_set_parameters_callback(self._before_set)
        node.add_post_set_parameters_callback(self._after_set)

    def enter(self, state: str) -> None:
        """Let a managed node in this state take what can be set in it."""
        self._state = state
        for name in self._class.model_fields:
            is_free = state == "unconfigured" and name != _MANAGED
            is_fixed = not is_free and name not in self._class.changeable
            self._node.describe_parameter(name).read_only = is_fixed

    def read_again(self) -> None:
        """Take the defaults anew: a file on which they depend may have changed."""
        config = validated(self._kind, self._given, self._class)
        if changed := self._changed(config, ()):
            self._node.remove_pre_set_parameters_callback(self._before_set)
            self._chosen = self._given, config
            result = self._node.set_parameters_atomically(changed)
            self._node.add_pre_set_parameters_callback(self._before_set)
            if not result.successful:
                raise NodeError(result.reason)

    def _before_set(self, parameters: Sequence[Parameter]) -> Sequence[Parameter]:
        """What is set, with the parameters whose defaults depend on it."""
        own, self._chosen = self._own(parameters), None
        if own and self._state in ("inactive", "finalized"):
            raise FixedParameterError(
                f"{', '.join(own)} cannot be set while the node is {self._state}; clean it up"
            )
        if not own or self._state != "unconfigured" or _MANAGED in own:
            for name in [each for each in own if each not in self._class.changeable]:
                raise FixedParameterError(
                    f"{name} is fixed while the node runs; start it again with -p {name}:=VALUE"
                )
            return parameters
        given = {**self._given, **own}
        try:
            config = validated(self._kind, given, self._class)
        except USER_ERRORS as error:
            raise FixedParameterError(str(error)) from None
        self._chosen = given, config
        # A whole number that was given for a float is declared as a float.
        others = [each for each in parameters if each.name not in own]
        taken = [Parameter(name, value=plain(getattr(config, name))) for name in own]
        return [*others, *taken, *self._changed(config, own)]

    def _after_set(self, parameters: Sequence[Parameter]) -> None:
        if self._chosen is None:
            self._given |= self._own(parameters)
        else:
            (self._given, self.config), self._chosen = self._chosen, None

    def _own(self, parameters: Sequence[Parameter]) -> dict[str, Any]:
        fields = self._class.model_fields
        return {each.name: plain(each.value) for each in parameters if each.name in fields}

    def _changed(self, config: Config, own: Collection[str]) -> list[Parameter]:
        """Parameters beside `own` that have another value in the config than now."""
        return [
            Parameter(name, value=plain(getattr(config, name)))
            for name in self._class.model_fields
            if name not in own and getattr(config, name) != getattr(self.config, name)
        ]


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
    text, limits = setting.description, setting.limits
    descriptor = ParameterDescriptor(description=text, additional_constraints=setting.range)
    low = limits.get("minimum", limits.get("exclusiveMinimum"))
    high = limits.get("maximum", limits.get("exclusiveMaximum"))
    if low is None or high is None:
        return descriptor
    if setting.schema["type"] == "integer":
        descriptor.integer_range = [IntegerRange(from_value=int(low), to_value=int(high), step=1)]
    else:
        span = FloatingPointRange(from_value=float(low), to_value=float(high))
        descriptor.floating_point_range = [span]
    return descriptor


def plain(value: Any) -> Any:
    """The value of a parameter, a sequence as a list."""
    return list(value) if isinstance(value, (list, tuple)) or hasattr(value, "tolist") else value
