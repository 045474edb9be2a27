"""The subcommands of `serd` and their exit codes."""

import os
import signal
import sys
from collections.abc import Sequence
from threading import Timer
from typing import Annotated, Any

import typer
from rich.text import Text
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command as click_command

from serd_bag.standard_output import written_output
from serd_cli.errors import BAD_INPUT, INTERRUPTED, RunError, UsageError
from serd_cli.output.terminal import progress_console
from serd_cli.signatures import MODULES, FlagGroup, app_of, known_signatures
from serd_core import __version__
from serd_files.errors import USER_ERRORS, missing_extra
from serd_files.moved_names import where


class LazyCommands(FlagGroup):
    """The group of all subcommands; the module of each is imported when it is called."""

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ARG002
        """Names in the order of the help."""
        return list(MODULES)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:  # noqa: ARG002
        """The subcommand, made from its signature; None where there is none."""
        if cmd_name not in MODULES:
            return None
        if cmd_name not in self.commands:
            group = click_command(app_of(cmd_name, known_signatures()))
            assert isinstance(group, TyperGroup)
            self.commands[cmd_name] = group.commands[cmd_name]
        return self.commands[cmd_name]

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The subcommand of args; names near a wrong one are those of all subcommands."""
        if args[0] not in MODULES:
            return self._overview().resolve_command(ctx, args)
        return super().resolve_command(ctx, args)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """The help, from one line per subcommand."""
        self._overview().format_help(ctx, formatter)

    def shell_complete(self, ctx: Any, incomplete: str) -> Any:
        """Completions, from one line per subcommand."""
        return self._overview().shell_complete(ctx, incomplete)

    def _overview(self) -> TyperGroup:
        """This group with one line per subcommand in place of the subcommands."""
        known = known_signatures()
        return TyperGroup(
            name=self.name,
            help=self.help,
            params=self.params,
            commands={name: TyperCommand(name, help=known[name]["help"]) for name in MODULES},
            rich_markup_mode=self.rich_markup_mode,
        )


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
    app.callback(help="Learn rewards and dynamics from demonstrations, and navigate with them.")(
        _options
    )
    return app


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"serd {__version__}")
        raise typer.Exit


def _options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", help="Print the version and exit.", callback=_print_version, is_eager=True
        ),
    ] = False,
) -> None:
    """Nothing is done without a subcommand."""


#: After this, an interrupt that Python ignored is repeated.
_REPEATED_AFTER_S = 0.05


def run(app: typer.Typer) -> int:
    """Run the command; its exit code. An error of the project is one line on stderr."""
    sys.unraisablehook = _repeat_interrupt
    exit_code = 0
    try:
        with written_output():
            _require_present(sys.argv[1:])
            exit_code = int(app(standalone_mode=True) or 0)
    except KeyboardInterrupt:
        progress_console.print("interrupted")
        return INTERRUPTED
    except USER_ERRORS as error:
        progress_console.print(Text.assemble(("serd:", "red"), f" {error}"), soft_wrap=True)
        return error.exit_code if isinstance(error, RunError) else BAD_INPUT
    except ModuleNotFoundError as error:
        if not (sentence := missing_extra(error)):
            raise
        progress_console.print(Text.assemble(("serd:", "red"), f" {sentence}"), soft_wrap=True)
        return BAD_INPUT
    return exit_code


def _require_present(words: Sequence[str]) -> None:
    """UsageError for a command or option of an earlier version."""
    if words and (went := where("command", words[0])):
        raise UsageError(f"there is no command {words[0]!r}; {went}")
    for word in words:
        option = word.partition("=")[0]
        if went := where("option", option):
            raise UsageError(f"there is no option {option}; {went}")


def _repeat_interrupt(ignored: Any) -> None:
    """Python ignores exceptions, also Ctrl-C, in `__del__` and callbacks of weak references."""
    if issubclass(ignored.exc_type, KeyboardInterrupt):
        Timer(_REPEATED_AFTER_S, os.kill, (os.getpid(), signal.SIGINT)).start()
    else:
        sys.__unraisablehook__(ignored)
