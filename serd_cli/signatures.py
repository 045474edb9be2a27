"""Signatures of all commands as data, from which help, completion and errors of usage are made.

A function of `serd_cli/commands` defines a command with its options; its module imports what the
command needs, which takes seconds. `make reference` writes the signatures to
`data/signatures.json`; a command made from this file imports its module when it is called.
"""

import inspect
import json
import re
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, TypedDict, Union, get_args, get_origin

import typer
from typer.core import TyperCommand, TyperGroup
from typer.models import ArgumentInfo, CommandInfo, OptionInfo, TyperInfo

from serd_bag.errors import disk_errors
from serd_cli.errors import UsageError
from serd_ros.process.executable import starting
from serd_sim.scenario.names import scenario_file, suite_names

FILE = Path(__file__).parent / "data" / "signatures.json"
#: Modules with a command of their name or a group, in the order of the help, and their folders in
#: `serd_cli.commands`.
MODULES = {
    "demo": "stacks", "teleop": "stacks", "watch": "stacks", "navigate": "stacks",
    "launch": "stacks", "run": "stacks", "bag": "learning",
    "demos": "learning", "learn": "learning", "report": "learning",
    "scenario": "simulation", "episode": "simulation",
    "batch": "simulation", "doctor": "stacks",
}  # fmt: skip
#: All that follows the executable is passed on.
_SETTINGS = {"run": {"allow_extra_args": True, "ignore_unknown_options": True}}
_TYPES: dict[str, Any] = {kind.__name__: kind for kind in (str, int, float, bool, Path)}
_TYPES["Context"] = typer.Context


class FlagGroup(TyperGroup):
    """A group whose own options are flags."""

    def get_params(self, ctx: Any) -> Any:
        """Its options, with False for None: to convert None, Typer imports pydantic."""
        found = super().get_params(ctx)
        for flag in found:
            flag.default = flag.default or False
        return found


class Signature(TypedDict, total=False):
    """A command with its parameters, or a group, which has none."""

    help: str
    settings: dict[str, Any]
    parameters: dict[str, dict[str, Any]]


def signatures() -> dict[str, Signature]:
    """By their words, as `bag info`: groups and commands, from the modules that define them."""
    return {words: each for module in MODULES for words, each in _signatures_of(module).items()}


def text_of(signatures: dict[str, Signature]) -> str:
    """The file, with a line per parameter."""
    text = json.dumps(signatures, indent=1, ensure_ascii=False, default=str)
    return re.sub(r"\n( {4,}|   (?=\}))", " ", text) + "\n"


def known_signatures() -> dict[str, Signature]:
    """The signatures by words, from the file."""
    found: dict[str, Signature] = json.loads(FILE.read_text(encoding="utf-8"))
    return found


def app_of(name: str, known: dict[str, Signature]) -> typer.Typer:
    """An app with one command or group only."""
    app = typer.Typer()
    app.callback()(lambda: None)  # keeps the name of a command that is the only one
    if "parameters" in known[name]:
        app.command(name, cls=_class(known[name]), **known[name]["settings"])(
            _function(name, name, known[name])
        )
        return app
    group = typer.Typer(cls=FlagGroup, help=known[name]["help"], **known[name]["settings"])
    for words, each in known.items():
        if words.startswith(f"{name} "):
            command = words.removeprefix(f"{name} ")
            group.command(command, cls=_class(each), **each["settings"])(
                _function(name, command, each)
            )
    group.callback()(lambda: None)
    app.add_typer(group, name=name)
    return app


def _class(signature: Signature) -> type[TyperCommand]:
    """The class of a command that refuses an empty path, which would be the current folder."""
    paths = {name for name, each in signature["parameters"].items() if each["type"] == "Path"}

    class NamedPaths(TyperCommand):
        def parse_args(self, ctx: Any, args: list[str]) -> Any:
            texts, _, _ = self.make_parser(ctx).parse_args(list(args))
            for each in self.params:
                text = texts.get(each.name)
                if each.name in paths and "" in (
                    text if isinstance(text, list | tuple) else [text]
                ):
                    name = each.opts[0] if each.opts[0].startswith("-") else each.opts[0].upper()
                    raise UsageError(
                        f"{name} must name a file or folder, got an empty text; write . for the"
                        " current folder"
                    )
            return super().parse_args(ctx, args)

    return NamedPaths


def _function(module: str, command: str, signature: Signature) -> Callable[..., None]:
    """A function with the parameters of a command; it imports the module and calls the command."""

    def call(**values: Any) -> None:
        for name, described in signature["parameters"].items():
            for path in _read_files(name, described, values[name]):
                with disk_errors("read", path):
                    path.stat()
        with starting():
            _, defined = _definitions(module)
        defined[command].callback(**values)  # type: ignore[misc]

    parameters = [_parameter(*item) for item in signature["parameters"].items()]
    call.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    call.__annotations__ = {each.name: each.annotation for each in parameters}
    call.__doc__ = signature["help"]
    return call


def _read_files(name: str, described: dict[str, Any], given: Any) -> list[Path]:
    """Files that a command reads, to be looked for before its import, which takes longer.

    Paths that are arguments or options with `exists`, and scenarios; SimError for one that is none.
    """
    named = given if isinstance(given, list | tuple) else [given] if given else []
    if name == "scenario":
        return [scenario_file(each) for each in named if each not in suite_names()]
    is_read = "argument" in described or described.get("option", {}).get("exists", False)
    return [*named] if is_read and described["type"] == "Path" else []


def _parameter(name: str, described: dict[str, Any]) -> inspect.Parameter:
    kind: Any = _TYPES[described["type"]]
    given = described.get("default", inspect.Parameter.empty)
    if kind is Path and isinstance(given, str):
        given = Path(given)
    if "choices" in described:
        kind = Literal[tuple(described["choices"])]
    if "many" in described:
        kind = list[kind]
    if "optional" in described:
        kind = kind | None
    if "argument" in described:
        kind = Annotated[kind, typer.Argument(**described["argument"])]
    if "option" in described:
        flags = described.get("flags", ())
        about = {key: each for key, each in described["option"].items() if key != "exists"}
        kind = Annotated[kind, typer.Option(*flags, **about)]
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=given, annotation=kind)


def _signatures_of(module: str) -> dict[str, Signature]:
    group, defined = _definitions(module)
    if group is None:
        return {module: _signature_of(defined[module])}
    commands = {f"{module} {name}": _signature_of(each) for name, each in defined.items()}
    return {module: {"help": group.help or "", "settings": _changed(group, "help")}, **commands}


def _definitions(module: str) -> tuple[TyperInfo | None, dict[str, CommandInfo]]:
    """The commands of a module by name, and the group they are in."""
    defined = vars(import_module(f"serd_cli.commands.{MODULES[module]}.{module}"))
    group: typer.Typer | None = defined.get("group")
    if group is not None:
        return group.info, {_name(each): each for each in group.registered_commands}
    command = CommandInfo(module, callback=defined[module], context_settings=_SETTINGS.get(module))
    parameters = _signature_of(command)["parameters"].values()
    command.no_args_is_help = any(
        "default" not in each and each["type"] != "Context" for each in parameters
    )
    return None, {module: command}


def _name(command: CommandInfo) -> str:
    return command.name or getattr(command.callback, "__name__", "").replace("_", "-")


def _signature_of(command: CommandInfo) -> Signature:
    assert command.callback is not None
    parameters = inspect.signature(command.callback, eval_str=True).parameters
    return {
        "help": inspect.getdoc(command.callback) or "",
        "settings": _changed(command, "name", "callback", "cls"),
        "parameters": {name: _described(each) for name, each in parameters.items()},
    }


def _described(parameter: inspect.Parameter) -> dict[str, Any]:
    kind, default = parameter.annotation, parameter.default
    info: Any = None
    flags: Sequence[str] = ()
    if get_origin(kind) is Annotated:
        kind, info = get_args(kind)
        flags = (info.default, *(info.param_decls or ())) if info.default != ... else ()
    elif isinstance(default, OptionInfo | ArgumentInfo):
        default, info = default.default, default
        flags = info.param_decls or ()
    return {
        **_described_type(kind),
        **({} if default in (inspect.Parameter.empty, ...) else {"default": default}),
        **({} if info is None else _described_info(info, flags)),
    }


def _described_type(kind: Any) -> dict[str, Any]:
    if get_origin(kind) is Annotated:
        return _described_type(get_args(kind)[0])
    if get_origin(kind) in (UnionType, Union):
        (inner,) = set(get_args(kind)) - {NoneType}
        return {**_described_type(inner), "optional": True}
    if get_origin(kind) is list:
        return {**_described_type(get_args(kind)[0]), "many": True}
    if get_origin(kind) is Literal:
        return {"type": "str", "choices": get_args(kind)}
    name = kind.__name__
    if _TYPES.get(name) is not kind:
        raise TypeError(f"a parameter of a command must be one of {', '.join(_TYPES)}, got {kind}")
    return {"type": name}


def _described_info(info: OptionInfo | ArgumentInfo, flags: Sequence[str]) -> dict[str, Any]:
    kind = "argument" if isinstance(info, ArgumentInfo) else "option"
    about = _changed(info, "default", "param_decls")
    return {kind: about, **({"flags": flags} if flags else {})}


def _changed(info: Any, *but: str) -> dict[str, Any]:
    """The attributes that differ from those of a new object, but those named."""
    usual = vars(type(info)())
    return {
        name: value
        for name, value in vars(info).items()
        if name not in but and type(value).__name__ != "DefaultPlaceholder" and value != usual[name]
    }
