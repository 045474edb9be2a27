"""A YAML file as a frozen, validated model; any fault is one sentence with file, key and fix."""

import json
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from storage.errors import FileError
from storage.text_file import read_text
from storage.validation_sentence import sentence_of
from storage.yaml_text import read_yaml, write_yaml


class StrictModel(BaseModel):
    """Frozen; refuses unknown keys and numbers that are not finite."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        allow_inf_nan=False,
        validate_default=True,
        protected_namespaces=(),
        ser_json_inf_nan="constants",
    )


Model = TypeVar("Model", bound=BaseModel)


def load_yaml_model(path: str | Path, model_class: type[Model]) -> Model:
    """The file as an instance of `model_class`; FileError with one sentence otherwise."""
    return yaml_model(read_text(path), model_class, name=str(path))


def yaml_model(text: str, model_class: type[Model], *, name: str) -> Model:
    """YAML text as an instance of `model_class`; `name` is what errors call the text.

    Types are strict: "3" is no number, true is no number, 1 is no boolean; 3 is a float.
    """
    values = read_yaml(text, name)
    if values is None:
        values = {}
    if not isinstance(values, dict):
        kind = type(values).__name__
        raise FileError(f"{name}: must hold keys and values ('key: value'), got a {kind}")
    _require_format(values, model_class, name)
    try:
        # By way of JSON, because pydantic's strict mode takes no list for a tuple otherwise.
        return model_class.model_validate_json(json.dumps(values), strict=True)
    except ValidationError as error:
        raise FileError(f"{name}: {sentence_of(error, model_class)}") from None
    except (TypeError, ValueError) as error:
        raise FileError(f"{name}: holds a value that is none of ours: {error}") from None


def _require_format(values: dict[str, Any], model_class: type[BaseModel], name: str) -> None:
    """Another kind of our files is named as such, before its keys are complained of one by one."""
    ours = model_class.model_fields.get("format")
    if ours is not None and "format" in values and values["format"] != ours.default:
        raise FileError(
            f"{name}: format must be {ours.default!r}, got {values['format']!r}; it is another kind"
            " of file"
        )


def model_yaml(model: BaseModel) -> str:
    """The model as YAML text that `yaml_model` reads back equal."""
    return write_yaml(model.model_dump(mode="json"))
