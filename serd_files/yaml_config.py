"""A YAML file as a frozen, validated model; any fault is one sentence with file, key and fix.

Text is read by the YAML 1.2 core schema. PyYAML alone reads 1.1: `1e-3` as a string, `1:30` as 90,
`no` as false, and of a key given twice the last. Here numbers are numbers, words are strings, and a
key given twice is refused. So are tags, which need not fit their value, and aliases, which grow
without bound when nested; no file of ours needs them.
"""

import json
import re
from collections.abc import Hashable, Iterator, Sequence
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import ErrorDetails

from serd_bag.errors import FileError, shortened
from serd_bag.files import atomic_write_text, read_text
from serd_bag.nearest import hint
from serd_files.moved_names import where_or_near

_CORE_SCHEMA = (
    ("null", re.compile(r"(?:~|null|Null|NULL|)$"), ["~", "n", "N", ""]),
    ("bool", re.compile(r"(?:true|True|TRUE|false|False|FALSE)$"), list("tTfF")),
    ("int", re.compile(r"[-+]?[0-9]+$"), list("-+0123456789")),
    (
        "float",
        re.compile(
            r"(?:[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?"
            r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN))$"
        ),
        list("-+.0123456789"),
    ),
)


class _Loader(yaml.SafeLoader):
    yaml_implicit_resolvers: dict[str, Any] = {}  # noqa: RUF012

    def compose_node(self, parent: Any, index: Any) -> Any:
        event = self.peek_event()  # type: ignore[no-untyped-call]
        if isinstance(event, yaml.AliasEvent) or event.tag is not None:
            fault = "aliases" if isinstance(event, yaml.AliasEvent) else "tags"
            raise yaml.composer.ComposerError(
                None, None, f"{fault} are refused; write the value out", event.start_mark
            )
        return super().compose_node(parent, index)

    def construct_mapping(self, node: Any, deep: bool = False) -> dict[Hashable, Any]:
        seen = set()
        for key_node, _ in node.value:
            key = key_node.value if isinstance(key_node, yaml.ScalarNode) else None
            if key in seen:
                raise yaml.constructor.ConstructorError(
                    None, None, f"the key {key!r} is given twice; remove one", key_node.start_mark
                )
            seen.add(key)
        return super().construct_mapping(node, deep)


class _Dumper(yaml.SafeDumper):
    """Also quotes what only the 1.2 schema takes for a number; 1.1 readers stay safe as well."""

    def ignore_aliases(self, data: Any) -> bool:  # noqa: ARG002
        return True


for _tag, _pattern, _first in _CORE_SCHEMA:
    _Loader.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", _pattern, _first)
    _Dumper.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", _pattern, _first)
_Loader.add_constructor("tag:yaml.org,2002:int", lambda _, node: int(node.value))


def read_yaml(text: str, name: str) -> Any:
    """Plain values of one YAML document; FileError names `name`, the line and the reason."""
    try:
        return yaml.load(text, _Loader)  # noqa: S506 (a SafeLoader with a stricter schema)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = f", line {mark.line + 1}, column {mark.column + 1}" if mark else ""
        raise FileError(f"{name}{place}: not valid YAML: {error.problem}") from None
    except yaml.YAMLError as error:
        reason = str(error).splitlines()[0]
        raise FileError(f"{name}: not valid YAML: {reason}; is it a text file?") from None
    except RecursionError:
        raise FileError(f"{name}: nested too deeply to be one of ours; check the file") from None
    except ValueError as error:
        raise FileError(f"{name}: not valid YAML: {error}") from None


def write_yaml(values: Any) -> str:
    """YAML text of plain values (dict, list, str, numbers, None), keys in the given order."""
    return yaml.dump(
        values, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=100,
        default_flow_style=None,
    )  # fmt: skip


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
