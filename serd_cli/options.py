"""Command options made from settings, shared options, and checks of paths."""

import inspect
import re
from collections.abc import Callable, Iterable, Mapping
from itertools import count
from os.path import lexists
from pathlib import Path
from types import GenericAlias
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, get_args, get_origin

import typer
from typer.core import TyperCommand

from serd_bag.errors import disk_errors
from serd_cli.errors import UsageError
from serd_sim.episodes.execution import Execution
from serd_sim.scenario.names import scenario_file, suite_names

if TYPE_CHECKING:
    from pydantic import BaseModel

Model = TypeVar("Model", bound="BaseModel")
Command = TypeVar("Command", bound=Callable[..., None])


def opt(text: str, *flags: str, **more: Any) -> Any:
    """An option with its help."""
    return typer.Option(*flags, help=text, **more)


def arg(text: str, metavar: str | None = None) -> Any:
    """An argument with its help."""
    return typer.Argument(metavar=metavar, help=text)


def present(given: Any) -> Any:
    """The paths that a command reads, each of which must exist; FileError for another.

    Checked before the imports of the command, which take longer.
    """
    for path in _listed(given):
        if path != _STANDARD:
            require_readable(path)
    return given


def require_readable(path: Path) -> None:
    """FileError where there is nothing at the path."""
    with disk_errors("read", path):
        path.stat()


def known_scenarios(given: Any) -> None:
    """Names of scenarios or suites, or files that must exist; SimError for any other."""
    named = [each for each in _listed(given) if each and each not in suite_names()]
    present([scenario_file(each) for each in named])


def _listed(given: Any) -> list[Any]:
    """All values of an option, of which there may be none."""
    if isinstance(given, list | tuple):
        return [*given]
    return [] if given is None else [given]


#: The standard input, for commands that read it.
_STANDARD = Path("-")
#: Where many tasks run by default.
EXECUTION = Execution()
AsJson = Annotated[bool, opt("print JSON instead of text", "--json")]
Jobs = Annotated[int, opt("processes at a time, -1 for all cores")]


def _command_class(function: Callable[..., None]) -> type[TyperCommand]:
    """The class of a command that refuses what it cannot read before its imports, which take long.

    These are empty paths, which would be the current folder, arguments that are paths to nothing,
    and scenarios that are not known.
    """
    hints = inspect.signature(function, eval_str=True).parameters
    paths = {name for name, each in hints.items() if _is_of_path(each.annotation)}

    class EarlyCommand(TyperCommand):
        def parse_args(self, ctx: Any, args: list[str]) -> Any:
            texts, _, _ = self.make_parser(ctx).parse_args(list(args))
            for each in self.params:
                if each.name in paths and "" in _listed(texts.get(each.name)):
                    is_option = each.param_type_name == "option"
                    name = each.opts[0] if is_option else each.metavar or each.opts[0].upper()
                    raise UsageError(
                        f"{name} must name a file or folder, got an empty text; write . for the"
                        " current folder"
                    )
            rest = super().parse_args(ctx, args)
            for each in self.params if not ctx.resilient_parsing else ():
                if each.param_type_name == "argument" and each.name in paths:
                    present(ctx.params[each.name])
                elif each.name == "scenario":
                    known_scenarios(ctx.params[each.name])
            return rest

    return EarlyCommand


def _is_of_path(kind: Any) -> bool:
    return kind is Path or any(map(_is_of_path, get_args(kind)))


def add_command(
    group: typer.Typer,
    name: str,
    function: Callable[..., None],
    about: str | None = None,
    settings: dict[str, Any] | None = None,
) -> None:
    """Add a command to a group; without a word it prints its help where it needs one.

    about: its help, the docstring of the function by default. settings: of its context.
    """
    parameters = inspect.signature(function).parameters.values()
    needed = {each.name for each in parameters if each.default is each.empty} - {"context"}
    # Typer keeps line breaks, which only examples need.
    text = re.sub(r"(?<=\S)\n(?=\S)(?!serd )", " ", about or inspect.getdoc(function) or "")
    group.command(
        name,
        cls=_command_class(function),
        help=text,
        short_help=text.partition("\n\n")[0],
        no_args_is_help=bool(needed),
        context_settings=settings,
    )(function)


def option(model: "type[BaseModel]", name: str, *flags: str, **changes: Any) -> Any:
    """The setting `name` of a model as a Typer option.

    flags: as `--transfer`, by default from the name; changes: a default of its own.
    """
    from serd_files.settings import settings_of

    found = next(each for each in settings_of(model) if each.name == name)
    limits = found.limits
    # Typer has inclusive limits only; `validated` checks the others.
    exclusive = limits.keys() & {"exclusiveMinimum", "exclusiveMaximum"}
    text = f"{found.description} [{found.range}]" if exclusive else found.description
    default = changes.get("default", found.default)
    if default is False and not flags:
        flags = (f"--{name.replace('_', '-')}",)  # no --no-...
    least, most = limits.get("minimum"), limits.get("maximum")
    return typer.Option(default, *flags, help=text, min=least, max=most)


def with_settings(model: "type[BaseModel]", **flags: str) -> Callable[[Command], Command]:
    """Decorator of a command with `**options`, which receives the settings of a model by name.

    Parameters that the command has itself are left as they are. flags: of settings whose option has
    another name, as `prior_weights="--prior-weight"`.
    """

    def settings(name: str, kind: Any) -> tuple[Any, Any]:
        # Typer has no tuple of any length.
        of_option = GenericAlias(list, get_args(kind)[0]) if get_origin(kind) is tuple else kind
        return of_option, option(model, name, *([flags[name]] if name in flags else []))

    fields = model.model_fields.items()
    more = {name: settings(name, field.annotation) for name, field in fields}
    return lambda command: with_parameters(command, more)


def with_parameters(command: Command, more: Mapping[str, tuple[Any, Any]]) -> Command:
    """The command with `**options`, which receives more parameters by name.

    more: their types and defaults; those that the command has itself are left as they are.
    """
    own = inspect.signature(command, eval_str=True).parameters.values()
    only_by_name = inspect.Parameter.KEYWORD_ONLY
    found = {
        each.name: each.replace(kind=only_by_name)
        for each in own
        if each.kind is not inspect.Parameter.VAR_KEYWORD
    }
    for name, (kind, default) in more.items():
        given = inspect.Parameter(name, only_by_name, default=default, annotation=kind)
        found.setdefault(name, given)
    command.__signature__ = inspect.Signature([*found.values()])  # type: ignore[attr-defined]
    command.__annotations__ = {name: each.annotation for name, each in found.items()}
    return command


def validated(model: type[Model], /, **values: Any) -> Model:
    """The values of the options as an instance of the model; UsageError names a bad one."""
    from pydantic import ValidationError

    from serd_files.yaml_config import sentence_of

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
    roots = (output / f"{name}-{number}" for number in count(1))
    root = next(each for each in roots if not lexists(each))
    with disk_errors("write", root):
        root.mkdir(parents=True)
    return root


def require_apart(output: Path, written: Iterable[Path], read: Iterable[str | Path]) -> None:
    """UsageError where a file that --output makes the command write is one that it reads."""
    from serd_files.files import shared_file

    if (path := shared_file(written, read)) is not None:
        raise UsageError(
            f"--output must not overwrite what is read, {output} would overwrite {path};"
            " name another file"
        )
