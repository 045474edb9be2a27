"""`serd-bag`: rescue, inspect, check, cut, merge and compare recordings, without ROS.

Exit codes: `EXIT_CODES` of the commands, 130 interrupted.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any

from serd_bag.command.commands import BAD_INPUT, EXIT_CODES, Page, run_command
from serd_bag.command.options import BAGS, COMMANDS, N_BAGS, OPTIONS, flag_of
from serd_bag.errors import FileError, printable
from serd_bag.standard_output import written_output

INTERRUPTED = 130
VERSION = "0.3.0"
_BETWEEN = "  "


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point."""
    exit_code = 0
    try:
        with written_output():
            words = sys.argv[1:] if arguments is None else [*arguments]
            if words[:1] == ["recover"]:
                raise FileError("recover is now called rescue; run 'serd-bag rescue BAG'")
            given = _parser().parse_args(words)
            screen = PlainScreen(as_json=getattr(given, "json", False))
            exit_code = run_command(given.command, given, screen)
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
        self.is_aside = False

    def values(self, values: list[dict[str, Any]]) -> None:
        """All results as JSON."""
        self._print(json.dumps(values, indent=2, ensure_ascii=False, allow_nan=False, default=str))

    def show(self, page: Page) -> None:
        """The table with a line below its head, then the lines; remarks on stderr."""
        self._print(page.heading)
        heads = list(zip_longest(*(column.split("\n") for column in page.columns), fillvalue=""))
        rows = [tuple(map(printable, row)) for row in page.rows]
        widths = [max(map(len, column)) for column in zip(*heads, *rows, strict=True)]
        ruler = tuple("-" * width for width in widths)
        for line in (*heads, ruler, *rows):
            cells = (
                text.ljust(width) if column in page.texts else text.rjust(width)
                for column, (text, width) in enumerate(zip(line, widths, strict=True))
            )
            self._print(_BETWEEN.join(cells).rstrip())
        for _, sentence in page.lines:
            self._print(printable(sentence))
        for remark in page.remarks:
            print(remark, file=sys.stderr)

    def _print(self, line: str) -> None:
        print(line, file=sys.stderr if self.is_aside else sys.stdout)


def _parser() -> argparse.ArgumentParser:
    description = "Rescue, inspect and rewrite recordings."
    parser = argparse.ArgumentParser(prog="serd-bag", description=description, epilog=EXIT_CODES)
    parser.add_argument("--version", action="version", version=f"serd-bag {VERSION}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, (options, about, more) in COMMANDS.items():
        command = commands.add_parser(
            name, help=about, description=f"{about}. {more}", epilog=EXIT_CODES
        )
        n_bags = N_BAGS.get(name, "+")
        command.add_argument("bags", metavar="BAG", nargs=n_bags, type=Path, help=BAGS)
        for option in options.split():
            command.add_argument(flag_of(option), dest=option, **OPTIONS[option])
    return parser


if __name__ == "__main__":
    sys.exit(main())
