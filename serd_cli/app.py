"""The subcommands of `serd` and their exit codes."""

from importlib import import_module

import typer
from rich.markup import escape

from serd_cli.errors import BAD_INPUT, INTERRUPTED, RunError
from serd_cli.output.terminal import progress_console
from serd_core.errors import SerdError

COMMANDS = (
    "demo",
    "teleop",
    "navigate",
    "launch",
    "run",
    "experiment",
    "bag",
    "demos",
    "learn",
    "compare",
    "scenario",
    "crowd",
    "episode",
    "batch",
    "faults",
    "study",
)


def make_app(wanted: str = "") -> typer.Typer:
    """The command with the wanted subcommand, or with all of them for help and misspelt names.

    Each is registered by the module of its name. Only the wanted one is imported, because the
    experiments and the report take two seconds to import.
    """
    app = typer.Typer(
        name="serd",
        help="Learn rewards and dynamics from demonstrations, and navigate with them.",
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        suggest_commands=True,
    )
    app.callback()(lambda: None)  # keeps subcommand names even where there is one only
    for name in [wanted] if wanted in COMMANDS else COMMANDS:
        import_module(f"serd_cli.commands.{name}").register(app)
    return app


def run(app: typer.Typer) -> int:
    """Run the command; its exit code. An error of the project is one line on stderr."""
    try:
        return int(app(standalone_mode=True) or 0)
    except KeyboardInterrupt:
        progress_console.print("interrupted")
        return INTERRUPTED
    except RunError as error:
        progress_console.print(f"[red]serd:[/red] {escape(str(error))}", soft_wrap=True)
        return error.exit_code
    except SerdError as error:
        progress_console.print(f"[red]serd:[/red] {escape(str(error))}", soft_wrap=True)
        return BAD_INPUT
