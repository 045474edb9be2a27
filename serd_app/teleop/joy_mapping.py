"""From a joystick's axes and buttons to a velocity, with the names and rules of teleop_twist_joy.

linear = scale_linear.x * axes[axis_linear.x], angular = scale_angular.yaw * axes[axis_angular.yaw],
with the turbo scales while enable_turbo_button is held. One stop is sent when enable_button is
released, then nothing. Axes and buttons that a message lacks count as 0.

At the start, after an emergency stop and after a message without the mapped axes, which a joystick
that has gone leaves, the command is a stop until both axes have returned to neutral.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, NonNegativeInt

from serd_app.teleop.twist_mux import read_parameters
from serd_files.yaml_config import StrictModel, write_yaml, yaml_model
from serd_sim.world.command import STOP, Command

_BUILTIN = Path(__file__).with_name("joy.yaml")
_NO_BUTTON = -1
#: Deflection up to which an axis counts as neutral.
_NEUTRAL = 0.1


#: By the names of teleop_twist_joy: index of an axis, and m/s or rad/s at full deflection.
_LinearAxis = Annotated[dict[Literal["x"], NonNegativeInt], Field(min_length=1)]
_AngularAxis = Annotated[dict[Literal["yaw"], NonNegativeInt], Field(min_length=1)]
_LinearScale = Annotated[dict[Literal["x"], float], Field(min_length=1)]
_AngularScale = Annotated[dict[Literal["yaw"], float], Field(min_length=1)]


class JoyMapping(StrictModel):
    """The parameters of teleop_twist_joy that apply to a unicycle; a button of -1 is none.

    guard_override_button is an extension.
    """

    axis_linear: _LinearAxis
    scale_linear: _LinearScale
    scale_linear_turbo: _LinearScale = Field(default={"x": 1.0})
    axis_angular: _AngularAxis
    scale_angular: _AngularScale
    scale_angular_turbo: _AngularScale = Field(default={"yaw": 1.0})
    require_enable_button: bool = True
    enable_button: int = Field(default=0, ge=0)
    enable_turbo_button: int = Field(default=_NO_BUTTON, ge=_NO_BUTTON)
    inverted_reverse: bool = False
    guard_override_button: int = Field(default=_NO_BUTTON, ge=_NO_BUTTON)


class JoyDriver:
    """Converts the messages of one joystick."""

    def __init__(self, mapping: JoyMapping) -> None:
        self._mapping = mapping
        self._driving = False
        self._was_neutral = False

    def require_neutral(self) -> None:
        """Stop until both axes have returned to neutral."""
        self._was_neutral = False

    def command(self, axes: Sequence[float], buttons: Sequence[int]) -> Command | None:
        """The command of a message; one stop after release, None while the joystick is disabled."""
        mapping = self._mapping
        turbo = _held(buttons, mapping.enable_turbo_button)
        enabled = _held(buttons, mapping.enable_button) or not mapping.require_enable_button
        was_driving, self._driving = self._driving, turbo or enabled
        self._follow_axes(axes)
        if self._driving:
            return self._scaled(axes, turbo=turbo) if self._was_neutral else STOP
        return STOP if was_driving else None

    def overrides(self, buttons: Sequence[int]) -> bool:
        """Whether the button that overrides the guard is held."""
        return _held(buttons, self._mapping.guard_override_button)

    def _follow_axes(self, axes: Sequence[float]) -> None:
        mapped = self._mapping.axis_linear["x"], self._mapping.axis_angular["yaw"]
        if max(mapped) >= len(axes):
            self._was_neutral = False
        elif all(abs(axes[index]) <= _NEUTRAL for index in mapped):
            self._was_neutral = True

    def _scaled(self, axes: Sequence[float], *, turbo: bool) -> Command:
        mapping = self._mapping
        linear = mapping.scale_linear_turbo if turbo else mapping.scale_linear
        angular = mapping.scale_angular_turbo if turbo else mapping.scale_angular
        linear_mps = linear["x"] * float(axes[mapping.axis_linear["x"]])
        angular_radps = angular["yaw"] * float(axes[mapping.axis_angular["yaw"]])
        if mapping.inverted_reverse and linear_mps < 0.0:
            angular_radps = -angular_radps
        return Command(linear_mps, angular_radps)


def load_joy_mapping(path: str | Path = "") -> JoyMapping:
    """The mapping in a file, bare or in the frame of a ROS parameter file; built in without a path.

    FileError names the key and the fix.
    """
    file = Path(path) if path else _BUILTIN
    return yaml_model(write_yaml(read_parameters(file)), JoyMapping, name=str(file))


def _held(buttons: Sequence[int], index: int) -> bool:
    return 0 <= index < len(buttons) and bool(buttons[index])
