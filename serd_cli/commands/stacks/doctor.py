"""`serd doctor`: what is installed and works, and the command that mends what does not."""

import os
from dataclasses import asdict
from pathlib import Path

import typer
from rich.table import Table
from rich.text import Text

from serd_cli.doctor.checks import Check, all_checks
from serd_cli.errors import FAILED
from serd_cli.options import AsJson
from serd_cli.output.terminal import console, print_json

_COLOURS = {"works": "green", "optional": "yellow", "fails": "red"}


def doctor(as_json: AsJson = False) -> None:
    """Check what is installed and works here, and name the command that mends it.

    serd doctor

    Nothing is changed. Exit code 1 where something that the main job needs fails.
    """
    found = list(all_checks(os.environ, Path.cwd()))
    if as_json:
        print_json([asdict(each) for each in found])
    else:
        console.print(checks_table(found))
        for each in found:
            if each.fix:
                print(f"{each.subject}: {each.fix}")
    if any(each.state == "fails" for each in found):
        raise typer.Exit(FAILED)


def checks_table(found: list[Check]) -> Table:
    """One row per check."""
    table = Table(show_header=False)
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for each in found:
        state = Text(each.state, style=_COLOURS[each.state])
        table.add_row(each.subject, state, each.finding)
    return table
