"""YAML text as plain values and back, by the YAML 1.2 core schema.

PyYAML alone reads 1.1: `1e-3` as a string, `1:30` as 90, `no` as false, and of a key given twice
the last. Here numbers are numbers, words are strings, and a key given twice is refused. So are
tags, which need not fit their value, and aliases, which grow without bound when nested; no file of
ours needs them.
"""

import re
from collections.abc import Hashable
from typing import Any

import yaml

from serd_bag.errors import FileError

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


def _decimal(loader: yaml.SafeLoader, node: yaml.ScalarNode) -> int:
    return int(loader.construct_scalar(node))


class _Dumper(yaml.SafeDumper):
    """Also quotes what only the 1.2 schema takes for a number; 1.1 readers stay safe as well."""

    def ignore_aliases(self, data: Any) -> bool:  # noqa: ARG002
        return True


for _tag, _pattern, _first in _CORE_SCHEMA:
    _Loader.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", _pattern, _first)
    _Dumper.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", _pattern, _first)
_Loader.add_constructor("tag:yaml.org,2002:int", _decimal)


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
