"""`serd-bag`: rescue, inspect, check, cut, merge and compare recordings, without ROS.

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
    rescue_bags,
    show_checks,
    show_contents,
)
from serd_bag.command.texts import TEXTS
from serd_bag.errors import FileError, printable
from serd_bag.standard_output import written_output

INTERRUPTED = 130
_BETWEEN = "  "


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point."""
    exit_code = 0
    try:
        with written_output():
            words = sys.argv[1:] if arguments is None else [*arguments]
            if words[:1] == ["recover"]:
                raise FileError("recover is now called rescue; run 'serd-bag rescue BAG'")
            exit_code = _done(_parser().parse_args(words))
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
        return show_contents(given.bags, screen, sizes=given.sizes)
    if given.command == "check":
        return show_checks(given.bags, given.require, screen)
    if given.command == "rescue":
        return rescue_bags(given.bags, given.output, screen, doubtful=not given.verified_only)
    return convert_bags(given.bags, given.output, given.compression, screen)


def _parser() -> argparse.ArgumentParser:
    description = "Rescue, inspect and rewrite recordings."
    parser = argparse.ArgumentParser(prog="serd-bag", description=description, epilog=EXIT_CODES)
    add = partial(
        parser.add_subparsers(dest="command", required=True, metavar="COMMAND").add_parser,
        epilog=EXIT_CODES,
    )
    shared = argparse.ArgumentParser(add_help=False)
    shared.add_argument("bags", metavar="BAG", nargs="+", type=Path, help=TEXTS["bags"])
    shared.add_argument("--json", action="store_true", help=TEXTS["json"])
    written = argparse.ArgumentParser(add_help=False)
    written.add_argument("--output", type=Path, help=TEXTS["output"])
    rescue = add("rescue", parents=[shared, written], help=TEXTS["rescue"])
    rescue.add_argument("--verified-only", action="store_true", help=TEXTS["verified_only"])
    info = add("info", parents=[shared], help=TEXTS["info"])
    info.add_argument("--sizes", action="store_true", help=TEXTS["sizes"])
    check = add("check", parents=[shared], help=TEXTS["check"])
    check.add_argument(
        "--require", action="append", default=[], metavar="TOPIC", help=TEXTS["require"]
    )
    convert = add("convert", parents=[shared, written], help=TEXTS["convert"])
    convert.add_argument(
        "--compression", choices=("none", "zstd"), default="none", help=TEXTS["compression"]
    )
    return parser


if __name__ == "__main__":
    sys.exit(main())
