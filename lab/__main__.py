"""`python -m lab NAME [options]`; without a name, the list of what there is.

Exit codes: 0 done, 2 bad usage or input, 130 interrupted.
"""

import os
import signal
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any

import typer
from rich.text import Text

from lab.catalogue import (
    BENCHMARKS,
    EXPERIMENTS,
    GROUPS,
    NAMES,
    OF_RESULTS,
    RUNS,
    VALIDATIONS,
    experiment_named,
)
from serd_bag.nearest import hint
from serd_bag.standard_output import written_output
from serd_cli.errors import BAD_INPUT, INTERRUPTED, UsageError
from serd_cli.output.terminal import progress_console
from serd_files.errors import USER_ERRORS


def main(words: Sequence[str]) -> int:
    """Run what the words name; its exit code. An error of the project is one line on stderr."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # so that processes are ended too
    try:
        with written_output():
            if not words or words[0] in ("-h", "--help"):
                print(overview())
                return 0
            name = words[0].replace("_", "-")
            app_of(name)(words[1:], prog_name=f"python -m lab {name}")
    except SystemExit as ended:  # of the command, when it is done too
        return int(ended.code or 0)
    except KeyboardInterrupt:
        progress_console.print("interrupted")
        return INTERRUPTED
    except USER_ERRORS as error:
        progress_console.print(Text.assemble(("lab:", "red"), f" {error}"), soft_wrap=True)
        return BAD_INPUT
    return 0


def overview() -> str:
    """All names with their lines, by group."""
    width = max(map(len, NAMES))
    groups = (
        "\n".join([f"{title}:", *(f"  {name:{width}}  {about}" for name, about in lines.items())])
        for title, lines in GROUPS.items()
    )
    return "\n\n".join(["Usage: python -m lab NAME [options]; python -m lab NAME --help", *groups])


def app_of(name: str) -> typer.Typer:
    """The command of a name, whose module is imported; UsageError where there is none."""
    if name not in NAMES:
        raise UsageError(f"no experiment or benchmark is named {name!r}; {hint(name, NAMES)}")
    app = typer.Typer(
        add_completion=False,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    command, about = _command_of(name)
    app.command(name, help=about)(command)
    return app


def _command_of(name: str) -> tuple[Callable[..., Any], str | None]:
    """The function of a name, and its help where that is not the function's docstring."""
    if name in EXPERIMENTS:
        command: Callable[..., Any] = import_module("lab.command.experiment").command_of(
            experiment_named(name)
        )
        return command, None
    if name in BENCHMARKS or name in RUNS:
        # Linear algebra gets one thread, so that processor times of ways with and without it
        # compare; the libraries read the variable when they load.
        os.environ.setdefault("OMP_NUM_THREADS", "1")
    if name in BENCHMARKS:
        benchmark = import_module(BENCHMARKS[name].module)
        return benchmark.run, benchmark.__doc__
    if name in OF_RESULTS:
        return getattr(import_module("lab.kept"), name), None
    module = name if name in (*VALIDATIONS, *RUNS) else "study"
    return getattr(import_module(f"lab.command.{module}"), name), None


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
