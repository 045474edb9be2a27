"""An experiment and its settings: fields of its frozen config, changed by a file or by options.

Fields of plain types are settings; each has its default and description in the config class.
"""

from collections.abc import Callable
from dataclasses import MISSING, Field, dataclass, field, fields
from pathlib import Path
from types import UnionType
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

import pandas as pd
from pydantic import TypeAdapter, ValidationError

from experiments.running.repetitions import Progress
from serd_core.errors import SerdError
from sim.episodes.execution import Execution
from storage.files import read_text
from storage.nearest import hint
from storage.yaml_text import read_yaml

_SIMPLE = (int, float, str, Path, bool)
Value = TypeVar("Value")
#: Of a config, an output folder, an execution and a progress callback; returns a summary table.
Run = Callable[[Any, Path, Execution, Progress], pd.DataFrame]


@dataclass(frozen=True)
class Experiment:
    """name; shows: its subject; config: type of its frozen configuration; run."""

    name: str
    shows: str
    config: type[Any]
    run: Run


def setting(default: Value, about: str) -> Value:
    """A dataclass field; default: immutable; about: its `--help`, a phrase without a full stop."""
    declared: Any = field(default=default, metadata={"about": about})
    return declared  # type: ignore[no-any-return]


def settings_of(experiment: Experiment) -> dict[str, tuple[Field[Any], Any]]:
    """Field and type of each setting, by name."""
    hints = get_type_hints(experiment.config)
    found = {each.name: (each, hints[each.name]) for each in fields(experiment.config)}
    return {name: pair for name, pair in found.items() if _is_plain(pair[1])}


def is_required(declared: Field[Any]) -> bool:
    """Whether a setting has no default."""
    return declared.default is MISSING and declared.default_factory is MISSING


def file_settings(experiment: Experiment, path: Path) -> dict[str, Any]:
    """Settings from a YAML file of `name: value`; SerdError for an unknown name."""
    values = _mapping(path)
    for name in values:
        if name not in settings_of(experiment):
            raise SerdError(
                f"{path}: {name} is no setting of {experiment.name}; "
                f"{hint(str(name), settings_of(experiment))}"
            )
    return values


def make_config(experiment: Experiment, given: dict[str, Any]) -> Any:
    """The experiment's config with its defaults, changed by plain values or text."""
    settings = settings_of(experiment)
    for name, (declared, _) in settings.items():
        if is_required(declared) and name not in given:
            option = f"--{name.replace('_', '-')}"
            about = declared.metadata["about"]
            raise SerdError(f"{option} must be given for {experiment.name}: {about}")
    typed = {name: _typed(name, value, settings[name][1]) for name, value in given.items()}
    return experiment.config(**typed)


def _mapping(path: Path) -> dict[str, Any]:
    content = read_yaml(read_text(path), str(path))
    if not isinstance(content, dict):
        raise SerdError(f"{path} must hold settings as 'name: value', got {content!r}")
    return content


def _typed(name: str, value: Any, kind: Any) -> Any:
    is_list = get_origin(kind) is tuple
    parts = value.split(",") if is_list and isinstance(value, str) else value
    try:
        return TypeAdapter(kind).validate_python(parts)
    except ValidationError as error:
        rule = error.errors()[0]["msg"]
        raise SerdError(f"--{name.replace('_', '-')} {value}: {rule}") from None


def _is_plain(kind: Any) -> bool:
    if get_origin(kind) in (Union, UnionType, tuple):
        return all(each in (*_SIMPLE, type(None), Ellipsis) for each in get_args(kind))
    return kind in _SIMPLE
