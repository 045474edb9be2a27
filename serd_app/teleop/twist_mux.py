"""Selection among several velocity commands, after twist_mux, with limits and an e-stop.

Of the inputs that are not silent and whose priority is not below that of an engaged lock, the one
with the highest priority drives, within the limits. Without such an input the command is stop. The
e-stop is a latch: engaged, it overrides everything until it is released. After the release each
input counts as a stop until it has sent a stop, or nothing within its timeout: what drove before
the release does not drive on. A stop for safety is passed on at once; the limits apply to driving
commands only:

    v' = clip(clip(w, low, high), v - a dt, v + a dt)

Settings are a YAML file in the vocabulary of twist_mux, also within `NODE: ros__parameters:`. Every
input has a timeout above 0, so that a silent one stops counting.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import Field, model_validator

from serd_bag.files import read_text
from serd_files.yaml_config import StrictModel, read_yaml, write_yaml, yaml_model
from serd_sim.world.command import STOP, Command, CommandGuard

_BUILTIN = Path(__file__).with_name("mux.yaml")
_LONGEST_TIMEOUT_S = 0.5
_LONGEST_STEP_S = 0.1


def read_parameters(path: Path) -> Any:
    """Plain values of a YAML file, without the frame of a ROS parameter file."""
    values = read_yaml(read_text(path), str(path))
    if isinstance(values, dict) and len(values) == 1:
        inner = next(iter(values.values()))
        if isinstance(inner, dict) and "ros__parameters" in inner:
            return inner["ros__parameters"]
    return values


class MuxTopic(StrictModel):
    """A source of velocity commands; timeout: seconds of silence after which it is inactive."""

    topic: str = Field(min_length=1)
    timeout: float = Field(gt=0, le=_LONGEST_TIMEOUT_S)
    priority: int = Field(ge=0, le=255)
    stamped: bool = False


class MuxLock(StrictModel):
    """A std_msgs/Bool; true, or silence for `timeout` (0: never), masks lower priorities."""

    topic: str = Field(min_length=1)
    timeout: float = Field(ge=0)
    priority: int = Field(ge=0, le=255)


class MuxSettings(StrictModel):
    """Inputs and locks by name."""

    topics: dict[str, MuxTopic] = Field(min_length=1)
    locks: dict[str, MuxLock] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _unambiguous(self) -> "MuxSettings":
        _require_distinct({name: each.priority for name, each in self.topics.items()}, "priority")
        listened: dict[str, Any] = {**self.topics, **self.locks}
        _require_distinct({name: each.topic for name, each in listened.items()}, "topic")
        return self


def load_mux(path: str | Path = "") -> MuxSettings:
    """The settings in a file, the built-in ones without a path; FileError names key and fix."""
    file = Path(path) if path else _BUILTIN
    return yaml_model(write_yaml(read_parameters(file)), MuxSettings, name=str(file))


def _require_distinct(values: dict[str, Any], what: str) -> None:
    owner: dict[Any, str] = {}
    for name, value in values.items():
        if value in owner:
            raise ValueError(
                f"{what} must differ between {owner[value]} and {name}, got {value!r} for both"
                "; change one"
            )
        owner[value] = name


@dataclass(frozen=True)
class VelocityLimits:
    """Speed and acceleration limits, named as in Nav2; accelerations apply to braking as well."""

    max_vel_x_mps: float
    min_vel_x_mps: float
    max_vel_theta_radps: float
    acc_lim_x_mps2: float
    acc_lim_theta_radps2: float

    def limited(self, wanted: Command, before: Command, duration_s: float) -> Command:
        """The nearest command within the limits that is reachable from `before` in that time."""
        reach_mps = self.acc_lim_x_mps2 * duration_s
        reach_radps = self.acc_lim_theta_radps2 * duration_s
        linear, angular = before.linear_mps, before.angular_radps
        fastest_radps = self.max_vel_theta_radps
        goal_mps = _clip(wanted.linear_mps, self.min_vel_x_mps, self.max_vel_x_mps)
        goal_radps = _clip(wanted.angular_radps, -fastest_radps, fastest_radps)
        return Command(
            linear_mps=_clip(goal_mps, linear - reach_mps, linear + reach_mps),
            angular_radps=_clip(goal_radps, angular - reach_radps, angular + reach_radps),
        )


def _clip(value: float, low: float, high: float) -> float:
    return min(max(value, low), high)


@dataclass(frozen=True)
class MuxOutput:
    """active: the input that drives, empty for none; locked_by: the engaged locks.

    held: inputs that count as a stop since the release of the e-stop.
    """

    command: Command
    active: str
    locked_by: tuple[str, ...]
    held: tuple[str, ...]
    e_stop: bool


class TwistMux:
    """The state of the mux; times are seconds of one monotonic clock that the caller reads."""

    def __init__(self, settings: MuxSettings, limits: VelocityLimits) -> None:
        self._settings, self._limits = settings, limits
        self._inputs = {name: CommandGuard(each.timeout) for name, each in settings.topics.items()}
        self._locks: dict[str, tuple[bool, float]] = {}
        self._e_stop = False
        self._held: set[str] = set()
        self._before, self._before_s = STOP, 0.0

    @property
    def n_rejected(self) -> Mapping[str, int]:
        """Commands that were not finite, by input; each was replaced by a stop."""
        return {name: guard.n_rejected for name, guard in self._inputs.items()}

    def receive(self, name: str, command: Command, now_s: float) -> None:
        """Store a command of an input."""
        if command == STOP and not self._e_stop:
            self._held.discard(name)
        self._inputs[name].receive(command, now_s)

    def receive_lock(self, name: str, engaged: bool, now_s: float) -> None:
        """Store the value of a lock's topic."""
        self._locks[name] = engaged, now_s

    def set_e_stop(self, engaged: bool) -> None:
        """Engage the latch, or release it."""
        self._e_stop = engaged
        if engaged:
            self._held = set(self._inputs)

    def step(self, now_s: float) -> MuxOutput:
        """The command for now; call it at a steady rate."""
        locked_by = self.engaged_locks(now_s)
        if not self._e_stop:
            self._held -= {
                name for name, each in self._inputs.items() if each.current(now_s) == STOP
            }
        active = "" if self._e_stop else self._active(locked_by, now_s)
        command = STOP
        if active:
            duration_s = min(max(now_s - self._before_s, 0.0), _LONGEST_STEP_S)
            wanted = STOP if active in self._held else self._inputs[active].current(now_s)
            command = self._limits.limited(wanted, self._before, duration_s)
        self._before, self._before_s = command, now_s
        held = tuple(name for name in self._inputs if name in self._held)
        return MuxOutput(command, active, locked_by, held, self._e_stop)

    def engaged_locks(self, now_s: float) -> tuple[str, ...]:
        """Locks whose last value is true, or whose timeout has passed without a message."""
        return tuple(name for name in self._settings.locks if self._is_engaged(name, now_s))

    def _is_engaged(self, name: str, now_s: float) -> bool:
        timeout_s = self._settings.locks[name].timeout
        if name not in self._locks:
            return timeout_s > 0.0
        engaged, heard_s = self._locks[name]
        return engaged or (timeout_s > 0.0 and not 0.0 <= now_s - heard_s <= timeout_s)

    def _active(self, locked_by: tuple[str, ...], now_s: float) -> str:
        barrier = max((self._settings.locks[name].priority for name in locked_by), default=-1)
        heard = [
            (each.priority, name)
            for name, each in self._settings.topics.items()
            if each.priority >= barrier and not self._inputs[name].is_stale(now_s)
        ]
        return max(heard)[1] if heard else ""
