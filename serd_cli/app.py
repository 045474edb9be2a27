"""The subcommands of `serd` and their exit codes."""

import sys
from importlib import import_module
from inspect import cleandoc
from typing import Annotated, Any

import typer
from rich.text import Text
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command as click_command

from serd_bag.standard_output import written_output
from serd_cli.errors import BAD_INPUT, INTERRUPTED, RunError, UsageError
from serd_cli.options import add_command, opt
from serd_cli.output.terminal import progress_console
from serd_core import __version__
from serd_files.errors import USER_ERRORS, missing_extra
from serd_files.moved_names import where
from serd_ros.process.executable import starting

#: Commands and groups with what they do, in the order of the help. The module of each, which has
#: its name, has its function or `group`, and as docstring the rest of its help.
COMMANDS = {
    "demo": "Demonstrate, record, learn, navigate and report, through ROS 2.",
    "teleop": "Drive by hand in real time, and save or discard what is recorded.",
    "watch": "Watch a running stack on a web page that drives nothing.",
    "bag": "Rescue, inspect, check, convert, map and play recordings.",
    "look": "Write the first page about a recording, without a model.",
    "demos": "Turn recordings into the table of decisions to learn from.",
    "learn": "Learn rewards and dynamics from a table of decisions.",
    "navigate": "Drive by a learned model; compare predicted and measured arrival.",
    "report": "Write the page of a learned model, with its forecast and policy.",
    "scenario": "List, draw and film scenarios, and write your own.",
    "batch": "Run every combination of scenarios, policies and seeds.",
    "launch": "Start a stack of nodes.",
    "run": "Run one node, as `ros2 run` does.",
    "doctor": "Check what is installed and works; name the command to mend it.",
}
#: The module of a command that has none of its own name; its help is the function's docstring.
_MODULES = {"run": "launch", "watch": "launch"}
#: All that follows the executable is passed on.
_SETTINGS = {"run": {"allow_extra_args": True, "ignore_unknown_options": True}}


class LazyCommands(TyperGroup):
    """The group of all subcommands; the module of each is imported when it is called."""

    def __init__(self, **options: Any) -> None:
        stubs = {name: TyperCommand(name, help=about) for name, about in COMMANDS.items()}
        super().__init__(**(options | {"commands": stubs}))

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The subcommand of args with its name, and what follows it."""
        name, stub, rest = super().resolve_command(ctx, args)
        if name is None:
            return name, stub, rest
        with starting():
            return name, command_named(name), rest


def command_named(name: str) -> Any:
    """The command or group of a module of `serd_cli.commands`, which is imported."""
    module = import_module(f"serd_cli.commands.{_MODULES.get(name, name)}")
    app: typer.Typer | None = getattr(module, "group", None)
    if app is None:
        app = typer.Typer(add_completion=False)
        function = getattr(module, name)
        more = cleandoc((function if name in _MODULES else module).__doc__ or "")
        add_command(app, name, function, f"{COMMANDS[name]}\n\n{more}", _SETTINGS.get(name))
    else:
        app.info.help = COMMANDS[name]
    command: Any = click_command(app)
    command.name, command.short_help = name, COMMANDS[name]
    return command


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"serd {__version__}")
        raise typer.Exit


Version = Annotated[
    bool, opt("Print the version and exit.", "--version", callback=_print_version, is_eager=True)
]


def make_app() -> typer.Typer:
    """The command with all its subcommands."""
    app = typer.Typer(
        name="serd",
        cls=LazyCommands,
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        suggest_commands=True,
        context_settings={"help_option_names": ["-h", "--help"]},
    )

    @app.callback(help="Learn rewards and dynamics from demonstrations, and navigate with them.")
    def _options(version: Version = False) -> None:
        """Nothing is done without a subcommand."""

    return app


def run(app: typer.Typer) -> int:
    """Run the command; its exit code. An error of the project is one line on stderr."""
    exit_code = 0
    try:
        with written_output():
            _require_present(sys.argv[1:])
            exit_code = int(app(standalone_mode=True) or 0)
    except KeyboardInterrupt:
        progress_console.print("interrupted")
        return INTERRUPTED
    except (*USER_ERRORS, ModuleNotFoundError) as error:
        missing = missing_extra(error) if isinstance(error, ModuleNotFoundError) else ""
        if isinstance(error, ModuleNotFoundError) and not missing:
            raise
        sentence = Text.assemble(("serd:", "red"), f" {missing or error}")
        progress_console.print(sentence, soft_wrap=True)
        return error.exit_code if isinstance(error, RunError) else BAD_INPUT
    return exit_code


def _require_present(words: list[str]) -> None:
    """UsageError for a command or option of an earlier version."""
    if words and (went := where("command", words[0])):
        raise UsageError(f"there is no command {words[0]!r}; {went}")
    # What follows an executable is its own.
    for word in words[:3] if words[:1] == ["run"] else words:
        option = word.partition("=")[0]
        if went := where("option", option):
            raise UsageError(f"there is no option {option}; {went}")
