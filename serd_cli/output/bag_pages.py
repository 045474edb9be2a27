"""What `serd bag` prints: pages of the bag commands in colours, and what a mapping gives."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.table import Table as RichTable
from rich.text import Text

from serd_bag.command.commands import Page
from serd_bag.quantities import counted
from serd_cli.output.terminal import console, print_json, progress_console

if TYPE_CHECKING:
    from serd_app.demonstrations.suggest import Suggestion

#: Of a column of names: rich narrows these first where the table is wider than the terminal.
_LEAST_TEXT_WIDTH = 12
_COLOURS = {"good": "green", "notable": "yellow", "bad": "red"}


def print_suggestion(found: "Suggestion", text: str, output: Path) -> None:
    """The mapping file, what it gives, and the command to use it with."""
    console.print(text, soft_wrap=True)
    if (report := found.report) is not None:
        console.print(
            f"on cells of {found.cell_size_m:g} m: {counted(report.n_decisions, 'decision')},"
            f" {report.n_censored} of them without outcome, {report.n_moving_waits} waits"
            " while the robot moves",
            soft_wrap=True,
        )
    console.print(f"mapping: {output.resolve()}", soft_wrap=True)
    console.print(f"next: {found.command(output)}", soft_wrap=True)


def suggestion_values(found: "Suggestion", bag: Path, output: Path) -> dict[str, Any]:
    """The same by name."""
    report = None if found.report is None else found.report.model_dump()
    values = {"bag": bag, "mapping": found.mapping.model_dump(mode="json")}
    return {**values, "comments": found.comments, "report": report, "file": output}


class RichScreen:
    """Prints in colours, tables with borders."""

    def __init__(self, *, as_json: bool) -> None:
        self.as_json = as_json

    def values(self, values: list[dict[str, Any]]) -> None:
        """All results as JSON."""
        print_json(values)

    def show(self, page: Page) -> None:
        """A table whose names are folded first where it is wider than the terminal, sentences in
        the colours of their styles; remarks on stderr."""
        console.print(Text(page.heading), soft_wrap=True)
        shown = RichTable()
        for number, name in enumerate(page.table.columns):
            if number in page.table.texts:
                shown.add_column(name, overflow="fold", min_width=_LEAST_TEXT_WIDTH)
            else:
                shown.add_column(name, justify="right", no_wrap=True)
        for row in page.table.rows:
            shown.add_row(*row)
        console.print(shown)
        for line in page.lines:
            console.print(Text(line.text, style=_COLOURS[line.style]), soft_wrap=True)
        for remark in page.remarks:
            progress_console.print(remark, style="yellow", soft_wrap=True)
