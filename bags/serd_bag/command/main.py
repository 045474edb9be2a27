"""`serd-bag`: info, check, recover and convert on any machine, without ROS.

Exit codes: `EXIT_CODES` of the commands, 130 interrupted.
"""

import argparse
import json
import shutil
import sys
import textwrap
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from serd_bag.command.commands import (
    BAD_INPUT,
    EXIT_CODES,
    Page,
    Table,
    convert_bags,
    recover_bags,
    show_checks,
    show_contents,
)
from serd_bag.errors import FileError
from serd_bag.standard_output import written_output

INTERRUPTED = 130
_LEAST_TEXT_WIDTH = 12
_BETWEEN = "  "


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point."""
    exit_code = 0
    try:
        with written_output():
            given = _parser().parse_args(arguments)
            exit_code = _done(given, PlainScreen(as_json=given.json))
    except FileError as error:
        print(f"serd-bag: {error}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        return INTERRUPTED
    return exit_code


class PlainScreen:
    """Prints to stdout, tables in columns as wide as the terminal."""

    def __init__(self, *, as_json: bool) -> None:
        self.as_json = as_json

    def values(self, values: list[dict[str, Any]]) -> None:
        """All results as JSON."""
        print(json.dumps(values, indent=2, ensure_ascii=False, allow_nan=False, default=str))

    def show(self, page: Page) -> None:
        """The table with a line below its head; remarks on stderr."""
        print(page.heading)
        table = page.table
        widths = _widths(table, shutil.get_terminal_size().columns)
        for number, row in enumerate((table.columns, *table.rows)):
            for line in _folded(row, widths, table.texts):
                print(line.rstrip())
            if number == 0:
                print(_BETWEEN.join("-" * width for width in widths))
        for sentence in page.lines:
            print(sentence.text)
        for remark in page.remarks:
            print(remark, file=sys.stderr)


def _done(given: argparse.Namespace, screen: PlainScreen) -> int:
    if given.command == "info":
        return show_contents(given.bags, screen)
    if given.command == "check":
        return show_checks(given.bags, given.require, screen)
    if given.command == "recover":
        return recover_bags(given.bags, given.output, screen)
    return convert_bags(given.bags, given.output, given.compression, screen)


def _widths(table: Table, most: int) -> list[int]:
    """Of each column; those of texts are folded where all together are wider than `most`."""
    cells = zip(table.columns, *table.rows, strict=True)
    widths = [
        max(len(line) for text in each for line in text.splitlines() or [""]) for each in cells
    ]
    while sum(widths) + len(_BETWEEN) * (len(widths) - 1) > most:
        widest = max(table.texts, key=lambda column: widths[column])
        if widths[widest] <= _LEAST_TEXT_WIDTH:
            break
        widths[widest] -= 1
    return widths


def _folded(row: Sequence[str], widths: Sequence[int], texts: Sequence[int]) -> Iterator[str]:
    """The lines of a row, numbers on the right of their columns."""
    cells = [
        [part for line in text.splitlines() for part in textwrap.wrap(line, width)]
        for text, width in zip(row, widths, strict=True)
    ]
    for number in range(max(map(len, cells))):
        parts = [cell[number] if number < len(cell) else "" for cell in cells]
        yield _BETWEEN.join(
            part.ljust(width) if column in texts else part.rjust(width)
            for column, (part, width) in enumerate(zip(parts, widths, strict=True))
        )


def _parser() -> argparse.ArgumentParser:
    description = "Inspect and repair recordings."
    parser = argparse.ArgumentParser(prog="serd-bag", description=description, epilog=EXIT_CODES)
    add = partial(
        parser.add_subparsers(dest="command", required=True, metavar="COMMAND").add_parser,
        epilog=EXIT_CODES,
    )
    shared = argparse.ArgumentParser(add_help=False)
    shared.add_argument(
        "bags", metavar="BAG", nargs="+", type=Path, help="bag folder, or .mcap, .db3 or .bag file"
    )
    shared.add_argument("--json", action="store_true", help="print JSON instead of text")
    written = argparse.ArgumentParser(add_help=False)
    written.add_argument("--output", type=Path, help="folder of the new bag")
    add("info", parents=[shared], help="show what bags hold")
    check = add("check", parents=[shared], help="read bags completely and list their faults")
    check.add_argument(
        "--require", action="append", default=[], metavar="TOPIC", help="that must have messages"
    )
    add(
        "recover",
        parents=[shared, written],
        help="write the readable messages of a damaged bag as a new bag, BAG_recovered",
    )
    convert = add("convert", parents=[shared, written], help="write a sound bag as MCAP, BAG_mcap")
    convert.add_argument("--compression", choices=("none", "zstd"), default="none")
    return parser


if __name__ == "__main__":
    sys.exit(main())
