"""The `serd` command; exit codes: 0 done, 1 a run failed, 2 bad usage or input, 130 interrupted."""

import sys

import typer
from rich.markup import escape

from serd_cli.commands.demo import demo
from serd_cli.commands.launch import launch
from serd_cli.commands.run import run
from serd_cli.errors import BAD_INPUT, FAILED, INTERRUPTED, RunError
from serd_cli.terminal import progress_console
from serd_core.errors import SerdError

app = typer.Typer(
    name="serd",
    help="Learn from demonstrations what a person wants and how the world answers; drive by it.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    suggest_commands=True,
)
app.command()(demo)
app.command()(launch)
app.command(context_settings={"allow_extra_args": True, "ignore_unknown_options": True})(run)


def main() -> int:
    """Entry point; every error of the project is one sentence on stderr."""
    try:
        return int(app(standalone_mode=True) or 0)
    except KeyboardInterrupt:
        progress_console.print("interrupted")
        return INTERRUPTED
    except RunError as error:
        progress_console.print(f"[red]serd:[/red] {escape(str(error))}", soft_wrap=True)
        return FAILED
    except SerdError as error:
        progress_console.print(f"[red]serd:[/red] {escape(str(error))}", soft_wrap=True)
        return BAD_INPUT


if __name__ == "__main__":
    sys.exit(main())
