"""Command options from settings: default, help and range are those of the model's field."""

from typing import Any, TypeVar

import typer
from pydantic import BaseModel, ValidationError

from serd_cli.errors import UsageError
from storage.settings import settings_of
from storage.yaml_config import sentence_of

Model = TypeVar("Model", bound=BaseModel)


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
