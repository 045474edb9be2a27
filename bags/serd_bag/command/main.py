"""`serd-bag`: info, check, recover and convert on any machine, without ROS.

Exit codes: `EXIT_CODES` of the commands, 130 interrupted.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from functools import partial
from itertools import zip_longest
from pathlib import Path
from typing import Any

from serd_bag.command.commands import (
    BAD_INPUT,
    EXIT_CODES,
    Page,
    convert_bags,
    recover_bags,
    show_checks,
    show_contents,
)
from serd_bag.errors import FileError, printable
from serd_bag.standard_output import written_output

INTERRUPTED = 130
_BETWEEN = "  "


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point."""
    exit_code = 0
    try:
        with written_output():
            exit_code = _done(_parser().parse_args(arguments))
    except FileError as error:
        print(f"serd-bag: {error}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        return INTERRUPTED
    return exit_code


class PlainScreen:
    """Prints to stdout, tables in columns as wide as their texts."""

    def __init__(self, *, as_json: bool) -> None:
        self.as_json = as_json

    def values(self, values: list[dict[str, Any]]) -> None:
        """All results as JSON."""
        print(json.dumps(values, indent=2, ensure_ascii=False, allow_nan=False, default=str))

    def show(self, page: Page) -> None:
        """The table with a line below its head, then the lines; remarks on stderr."""
        print(page.heading)
        heads = list(zip_longest(*(column.split("\n") for column in page.columns), fillvalue=""))
        rows = [tuple(map(printable, row)) for row in page.rows]
        widths = [max(map(len, column)) for column in zip(*heads, *rows, strict=True)]
        ruler = tuple("-" * width for width in widths)
        for line in (*heads, ruler, *rows):
            cells = (
                text.ljust(width) if column in page.texts else text.rjust(width)
                for column, (text, width) in enumerate(zip(line, widths, strict=True))
            )
            print(_BETWEEN.join(cells).rstrip())
        for _, sentence in page.lines:
            print(printable(sentence))
        for remark in page.remarks:
            print(remark, file=sys.stderr)


def _done(given: argparse.Namespace) -> int:
    screen = PlainScreen(as_json=given.json)
    if given.command == "info":
        return show_contents(given.bags, screen)
    if given.command == "check":
        return show_checks(given.bags, given.require, screen)
    if given.command == "recover":
        return recover_bags(given.bags, given.output, screen)
    return convert_bags(given.bags, given.output, given.compression, screen)


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
