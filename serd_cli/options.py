"""Command options made from settings, shared options, and checks of output paths."""

import inspect
from collections.abc import Callable, Iterable, Mapping
from itertools import count
from os.path import lexists
from pathlib import Path
from types import GenericAlias
from typing import Annotated, Any, TypeVar, get_args, get_origin

import typer
from pydantic import BaseModel, ValidationError

from serd_bag.errors import disk_errors
from serd_cli.errors import UsageError
from serd_files.files import shared_file
from serd_files.settings import settings_of
from serd_files.yaml_config import sentence_of
from serd_sim.episodes.execution import BACKENDS, Execution

Model = TypeVar("Model", bound=BaseModel)
Command = TypeVar("Command", bound=Callable[..., None])

AsJson = Annotated[bool, typer.Option("--json", help="print JSON instead of text")]
#: Where many tasks run by default.
EXECUTION = Execution()
Jobs = Annotated[int, typer.Option(help="processes at a time, -1 for all cores")]
Backend = Annotated[str, typer.Option(help=", ".join(BACKENDS))]
Address = Annotated[
    str, typer.Option(help="of a running Dask scheduler; else a local cluster is started")
]


def option(model: type[BaseModel], name: str, *flags: str, **changes: Any) -> Any:
    """The setting `name` of a model as a Typer option.

    flags: as `--transfer`, by default from the name; changes: a default or a help text of its own.
    """
    found = next(each for each in settings_of(model) if each.name == name)
    limits = found.limits
    # Typer has inclusive limits only; `validated` checks the others.
    exclusive = limits.keys() & {"exclusiveMinimum", "exclusiveMaximum"}
    default = changes.pop("default", found.default)
    if default is False and not flags:
        flags = (_flag(name),)  # no --no-...
    described = {
        "min": limits.get("minimum"),
        "max": limits.get("maximum"),
        "help": f"{found.description} [{found.range}]" if exclusive else found.description,
    }
    return typer.Option(default, *flags, **(described | changes))


def with_settings(model: type[BaseModel], **flags: str) -> Callable[[Command], Command]:
    """Decorator of a command with `**options`, which receives the settings of a model by name.

    Parameters that the command has itself are left as they are. flags: of settings whose option has
    another name, as `prior_weights="--prior-weight"`.
    """

    def decorate(command: Command) -> Command:
        settings = {
            name: (
                _option_type(field.annotation),
                option(model, name, *([flags[name]] if name in flags else [])),
            )
            for name, field in model.model_fields.items()
        }
        return with_parameters(command, settings)

    return decorate


def with_parameters(command: Command, more: Mapping[str, tuple[Any, Any]]) -> Command:
    """The command with `**options`, which receives more parameters by name.

    more: their types and defaults; those that the command has itself are left as they are.
    """
    own = inspect.signature(command, eval_str=True).parameters.values()
    named = {each.name: each for each in own if each.kind is not inspect.Parameter.VAR_KEYWORD}
    found = {name: (each.annotation, each.default) for name, each in named.items()}
    found = {**found, **{name: each for name, each in more.items() if name not in found}}
    only_by_name = inspect.Parameter.KEYWORD_ONLY
    parameters = [
        inspect.Parameter(name, only_by_name, default=default, annotation=kind)
        for name, (kind, default) in found.items()
    ]
    command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    command.__annotations__ = {name: kind for name, (kind, _) in found.items()}
    return command


def _option_type(kind: Any) -> Any:
    """list[kind] for a tuple of any length, which Typer does not have."""
    return GenericAlias(list, get_args(kind)[0]) if get_origin(kind) is tuple else kind


def _flag(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def validated(model: type[Model], /, **values: Any) -> Model:
    """The values of the options as an instance of the model; UsageError names a bad one."""
    try:
        return model(**values)
    except ValidationError as error:
        raise UsageError(sentence_of(error, model)) from None


def resolved_scenario(name: str) -> str:
    """The name of a built-in scenario, or the absolute path of a scenario file."""
    return str(Path(name).resolve()) if Path(name).is_file() else name


def require_suffix(output: Path, *suffixes: str) -> None:
    """UsageError where --output has none of the suffixes, in letters of either case."""
    if output.suffix.lower() not in suffixes:
        raise UsageError(
            f"--output must end in {', '.join(suffixes)}, got {output}; name a {suffixes[0]} file"
        )


def free_folder(output: Path, name: str) -> Path:
    """Make the next free folder `name-N` below `output`; nothing is ever overwritten."""
    for number in count(1):
        root = output / f"{name}-{number}"
        with disk_errors("write", root):
            try:
                root.mkdir(parents=True)
                break
            except FileExistsError:
                if not lexists(root):  # a folder above is a link to nothing
                    raise
    return root


def require_apart(output: Path, written: Iterable[Path], read: Iterable[str | Path]) -> None:
    """UsageError where a file that --output makes the command write is one that it reads."""
    if (path := shared_file(written, read)) is not None:
        raise UsageError(
            f"--output must not overwrite what is read, {output} would overwrite {path};"
            " name another file"
        )
