"""Command options made from settings, with their default, help and range, and shared options."""

import inspect
from collections.abc import Callable
from pathlib import Path
from types import GenericAlias
from typing import Annotated, Any, TypeVar, get_args, get_origin

import typer
from pydantic import BaseModel, ValidationError

from serd_cli.errors import UsageError
from sim.episodes.execution import BACKENDS, Execution
from storage.settings import settings_of
from storage.yaml_config import sentence_of

Model = TypeVar("Model", bound=BaseModel)
Command = TypeVar("Command", bound=Callable[..., None])

AsJson = Annotated[bool, typer.Option("--json", help="print JSON instead of text")]
#: Where many tasks run by default.
EXECUTION = Execution()
Jobs = Annotated[int, typer.Option(help="processes at a time, -1 for all cores")]
Backend = Annotated[str, typer.Option(help=", ".join(BACKENDS))]
Address = Annotated[
    str, typer.Option(help="of a running Dask or Ray cluster; else a local one is started")
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
        own = inspect.signature(command, eval_str=True).parameters
        kinds = {name: each.annotation for name, each in own.items() if name != "options"}
        defaults = {name: each.default for name, each in own.items()}
        for name, field in model.model_fields.items():
            if name not in kinds:
                kinds[name] = _option_type(field.annotation)
                defaults[name] = option(model, name, *([flags[name]] if name in flags else []))
        only_by_name = inspect.Parameter.KEYWORD_ONLY
        parameters = [
            inspect.Parameter(name, only_by_name, default=defaults[name], annotation=kind)
            for name, kind in kinds.items()
        ]
        command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        command.__annotations__ = kinds
        return command

    return decorate


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
