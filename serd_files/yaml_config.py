"""A YAML file as a frozen, validated model; any fault is one sentence with file, key and fix."""

import json
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import ErrorDetails

from serd_bag.errors import FileError, shortened
from serd_bag.files import atomic_write_text, read_text
from serd_bag.nearest import hint
from serd_files.moved_names import where_or_near
from serd_files.yaml_text import read_yaml, write_yaml


class StrictModel(BaseModel):
    """Frozen; refuses unknown keys and numbers that are not finite."""

    model_config = ConfigDict(
        defer_build=True,  # a node uses few of the models that it imports
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
    """Another kind or version of our files is named as such, before its keys are complained of one
    by one."""
    ours = model_class.model_fields.get("format")
    if ours is not None and "format" in values and values["format"] != ours.default:
        raise FileError(
            f"{name}: format must be {ours.default!r}, got {values['format']!r}; it is another kind"
            " of file"
        )
    version = model_class.model_fields.get("format_version")
    if version is not None and values.get("format_version", version.default) != version.default:
        raise FileError(
            f"{name}: format_version must be {version.default}, got {values['format_version']!r} of"
            f" another version; {getattr(model_class, 'remade_by', 'make the file again')}"
        )


def model_yaml(model: BaseModel) -> str:
    """The model as YAML text that `yaml_model` reads back equal."""
    return write_yaml(model.model_dump(mode="json"))


def save_yaml_model(path: str | Path, model: BaseModel) -> None:
    """Write the model as a file that `load_yaml_model` reads back equal."""
    atomic_write_text(path, model_yaml(model))


_PLAIN_WORDS = {
    "must be have": "must have",
    " a valid integer": " an integer",
    " a valid ": " a ",
    " array": " list",
    " object": " group of keys",
    " after validation": "",
}


def sentence_of(error: ValidationError, model_class: type[BaseModel]) -> str:
    """The most specific of the faults; the number of the others is added."""
    details = sorted(error.errors(include_url=False), key=_rank)
    others = len(details) - 1
    more = f" ({others} more fault{'s' if others > 1 else ''})" if others else ""
    return _sentence(details[0], model_class) + more


def dotted(place: Sequence[int | str]) -> str:
    """A place inside a file as people write it: `walls[2].outline_m`."""
    parts = [f"[{step}]" if isinstance(step, int) else f".{step}" for step in place]
    return "".join(parts).lstrip(".")


def _rank(detail: ErrorDetails) -> int:
    """An unknown key first: the missing one it was meant to be is its consequence."""
    return {"extra_forbidden": 0, "missing": 2}.get(detail["type"], 1)


def _sentence(detail: ErrorDetails, model_class: type[BaseModel]) -> str:
    key = dotted(detail["loc"])
    if detail["type"] == "extra_forbidden":
        name = str(detail["loc"][-1])
        known = keys_at(model_class, detail["loc"][:-1])
        return f"{key} is not a known key; {where_or_near('key', name, known)}"
    if detail["type"] == "missing":
        return f"{key} is required but missing; add it"
    if detail["type"] in ("value_error", "assertion_error"):
        return _own_rule(key, detail["msg"].split(", ", 1)[1])
    value = shortened(repr(detail["input"]))
    return f"{key or 'the file'} {_rule(detail)}, got {value}{_near(detail)}"


def _own_rule(key: str, message: str) -> str:
    if not key:
        return message
    return f"{key} {message}" if message.startswith(("must ", "is ")) else f"{key}: {message}"


def _rule(detail: ErrorDetails) -> str:
    if detail["type"] == "model_type":
        return "must hold keys and values"
    message = re.sub(r"^Input should (?:be )?", "must be ", detail["msg"])
    message = re.sub(r"^(\w+) should ", "must ", message)
    for pydantic_word, plain_word in _PLAIN_WORDS.items():
        message = message.replace(pydantic_word, plain_word)
    return message


def _near(detail: ErrorDetails) -> str:
    if detail["type"] != "literal_error":
        return ""
    allowed = re.findall(r"'([^']*)'", detail["ctx"]["expected"])
    return f"; {hint(str(detail['input']), allowed)}"


def keys_at(model_class: type[BaseModel], place: Sequence[int | str]) -> tuple[str, ...]:
    """Names of the fields allowed at `place`, a path of keys and indices from the root."""
    found: list[Any] = [model_class]
    for step in place:
        found = [inner for each in found for inner in _inside(each, step)] or found
    inner = (each for annotation in found for each in _alternatives(annotation))
    fields = [field for each in inner if _is_model(each) for field in each.model_fields.items()]
    return tuple(sorted({field.alias or name for name, field in fields}))


def _inside(annotation: Any, step: int | str) -> Iterator[Any]:
    for each in _alternatives(annotation):
        if _is_model(each):
            if step in each.model_fields:
                yield each.model_fields[step].annotation
        elif get_origin(each) is dict:
            yield get_args(each)[1]
        elif isinstance(step, int):
            yield from (part for part in get_args(each) if part is not Ellipsis)


def _alternatives(annotation: Any) -> Iterator[Any]:
    origin = get_origin(annotation)
    if origin is Annotated:
        yield from _alternatives(get_args(annotation)[0])
    elif origin in (Union, UnionType):
        for part in get_args(annotation):
            yield from _alternatives(part)
    else:
        yield annotation


def _is_model(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)
