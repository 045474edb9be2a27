"""Settings of the command mux: a YAML file in the vocabulary of twist_mux.

A file for twist_mux itself is accepted as it is: its `NODE: ros__parameters:` frame is removed and
`use_stamped` is understood. Every input has a timeout above 0, so that a silent one stops counting.
"""

from pathlib import Path
from typing import Any

from pydantic import Field, model_validator

from serd_bag.files import read_text
from serd_files.yaml_config import StrictModel, yaml_model
from serd_files.yaml_text import read_yaml, write_yaml

_FRAME = "ros__parameters"
_BUILTIN = Path(__file__).with_name("mux.yaml")
_LONGEST_TIMEOUT_S = 0.5


def read_parameters(path: Path) -> Any:
    """Plain values of a YAML file, without the frame of a ROS parameter file."""
    values = read_yaml(read_text(path), str(path))
    if isinstance(values, dict) and len(values) == 1:
        inner = next(iter(values.values()))
        if isinstance(inner, dict) and _FRAME in inner:
            return inner[_FRAME]
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
    values = _with_stamped_spread(read_parameters(file))
    return yaml_model(write_yaml(values), MuxSettings, name=str(file))


def _with_stamped_spread(values: Any) -> Any:
    """Copy `use_stamped`, which twist_mux has once for all topics, into every topic."""
    if not isinstance(values, dict) or "use_stamped" not in values:
        return values
    rest = {key: value for key, value in values.items() if key != "use_stamped"}
    topics = rest.get("topics")
    if isinstance(topics, dict):
        rest["topics"] = {
            name: {"stamped": values["use_stamped"], **each} if isinstance(each, dict) else each
            for name, each in topics.items()
        }
    return rest


def _require_distinct(values: dict[str, Any], what: str) -> None:
    owner: dict[Any, str] = {}
    for name, value in values.items():
        if value in owner:
            raise ValueError(
                f"{what} must differ between {owner[value]} and {name}, got {value!r} for both"
                "; change one"
            )
        owner[value] = name
