"""Command options made from settings, with their default, help and range, and shared options."""

from typing import Annotated, Any, TypeVar

import typer
from pydantic import BaseModel, ValidationError

from serd_cli.errors import UsageError
from sim.episodes.execution import BACKENDS
from storage.settings import settings_of
from storage.yaml_config import sentence_of

Model = TypeVar("Model", bound=BaseModel)

# Where many tasks run.
Jobs = Annotated[int, typer.Option(help="processes at a time, -1 for all cores")]
Backend = Annotated[str, typer.Option(help=", ".join(BACKENDS))]
Address = Annotated[
    str, typer.Option(help="of a running Dask or Ray cluster; else a local one is started")
]


def option(model: type[BaseModel], name: str, *flags: str) -> Any:
    """The setting `name` of a model as a Typer option; flags: as `--transfer`, else from the name.

    Write it as the default of a command's parameter: `seed: int = option(EpisodeSettings, "seed")`.
    """
    found = next(each for each in settings_of(model) if each.name == name)
    limits = found.limits
    # Typer has inclusive limits only; `validated` checks the others.
    exclusive = limits.keys() & {"exclusiveMinimum", "exclusiveMaximum"}
    return typer.Option(
        found.default,
        *flags,
        min=limits.get("minimum"),
        max=limits.get("maximum"),
        help=f"{found.description} [{found.range}]" if exclusive else found.description,
    )


def validated(model: type[Model], /, **values: Any) -> Model:
    """The values of the options as an instance of the model; UsageError names a bad one."""
    try:
        return model(**values)
    except ValidationError as error:
        raise UsageError(sentence_of(error, model)) from None
