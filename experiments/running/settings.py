"""Settings of the experiments: defaults in experiments.yaml, changes from a file or from words.

Each experiment has a frozen config class; what can be written in YAML of it is a setting.
"""

from dataclasses import MISSING, Field, fields
from functools import cache
from pathlib import Path
from types import UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

from pydantic import TypeAdapter, ValidationError

from experiments.catalogue import Experiment
from serd_core.errors import SerdError
from storage.files import read_text
from storage.nearest import hint
from storage.yaml_text import read_yaml

EXPERIMENTS_YAML = Path(__file__).with_name("experiments.yaml")
_SIMPLE = (int, float, str, Path, bool)


@cache
def default_settings(name: str) -> dict[str, Any]:
    """Plain values of an experiment's settings; those that must be given are missing."""
    return dict(_mapping(EXPERIMENTS_YAML)[name] or {})


def settings_of(experiment: Experiment) -> dict[str, tuple[Field[Any], Any]]:
    """Field and type of each setting, by name."""
    hints = get_type_hints(experiment.config)
    found = {field.name: (field, hints[field.name]) for field in fields(experiment.config)}
    return {name: each for name, each in found.items() if _is_plain(each[1])}


def is_required(field: Field[Any]) -> bool:
    """Whether a setting has no default."""
    return field.default is MISSING and field.default_factory is MISSING


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
    """The experiment's config from the defaults and what is given (plain values or words)."""
    settings = settings_of(experiment)
    values = {**default_settings(experiment.name), **given}
    for name, (field, _) in settings.items():
        if is_required(field) and name not in values:
            option = f"--{name.replace('_', '-')}"
            about = field.metadata["about"]
            raise SerdError(f"{option} must be given for {experiment.name}: {about}")
    typed = {name: _typed(name, value, settings[name][1]) for name, value in values.items()}
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
