"""`serd-bag`: rescue, inspect, check, cut, merge and compare recordings, without ROS.

Exit codes: `EXIT_CODES` of the commands, 130 interrupted.
"""

import argparse
import json
import math
import shutil
import sys
from collections.abc import Sequence
from itertools import zip_longest
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from serd_bag.command.commands import (
    BAD_INPUT,
    EXIT_CODES,
    Page,
    convert_bags,
    cut_bags,
    print_messages,
    reindex_bags,
    rescue_bags,
    show_checks,
    show_contents,
    show_difference,
)
from serd_bag.command.texts import TEXTS
from serd_bag.errors import FileError, printable
from serd_bag.standard_output import written_output

INTERRUPTED = 130
VERSION = "0.3.0"
#: The options of each command.
COMMANDS = {
    "rescue": "output verified_only json",
    "info": "sizes json",
    "check": "require json",
    "convert": "output compression json",
    "cut": "output topic without from to split_mb sort compression json",
    "merge": "output topic without from to split_mb sort compression json",
    "cat": "topic without from to columns",
    "diff": "json",
    "reindex": "json",
}
_N_BAGS = {"cat": 1, "diff": 2}
_FLAG: dict[str, Any] = {"action": "store_true"}
_SEVERAL: dict[str, Any] = {"action": "append", "default": [], "metavar": "REGEX"}
#: How argparse reads each option.
_KINDS: dict[str, dict[str, Any]] = {
    "output": {"type": Path, "metavar": "FOLDER"},
    **dict.fromkeys(("json", "sizes", "sort", "verified_only"), _FLAG),
    **dict.fromkeys(("topic", "without"), _SEVERAL),
    "require": {**_SEVERAL, "metavar": "TOPIC"},
    "compression": {"choices": ("none", "zstd"), "default": "none"},
    "from": {"type": float, "default": -math.inf, "metavar": "S"},
    "to": {"type": float, "default": math.inf, "metavar": "S"},
    "split_mb": {"type": float, "metavar": "MB"},
    "columns": {"metavar": "FIELDS"},
}
_STANDARD = Path("-")
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
        self.file = sys.stdout

    def values(self, values: list[dict[str, Any]]) -> None:
        """All results as JSON."""
        text = json.dumps(values, indent=2, ensure_ascii=False, allow_nan=False, default=str)
        print(text, file=self.file)

    def show(self, page: Page) -> None:
        """The table with a line below its head, then the lines; remarks on stderr."""
        print(page.heading, file=self.file)
        heads = list(zip_longest(*(column.split("\n") for column in page.columns), fillvalue=""))
        rows = [tuple(map(printable, row)) for row in page.rows]
        widths = [max(map(len, column)) for column in zip(*heads, *rows, strict=True)]
        ruler = tuple("-" * width for width in widths)
        for line in (*heads, ruler, *rows):
            cells = (
                text.ljust(width) if column in page.texts else text.rjust(width)
                for column, (text, width) in enumerate(zip(line, widths, strict=True))
            )
            print(_BETWEEN.join(cells).rstrip(), file=self.file)
        for _, sentence in page.lines:
            print(printable(sentence), file=self.file)
        for remark in page.remarks:
            print(remark, file=sys.stderr)


def _done(given: argparse.Namespace) -> int:
    screen = PlainScreen(as_json=getattr(given, "json", False))
    with TemporaryDirectory() as folder:
        given.bags = [_standard_input(Path(folder), bag) for bag in given.bags]
        output = getattr(given, "output", None)
        if output != _STANDARD:
            return _run(given, screen)
        given.output = Path(folder) / "output"
        screen.file = sys.stderr
        code = _run(given, screen)
        for file in sorted(given.output.glob("*.mcap")):
            with file.open("rb") as stream:
                shutil.copyfileobj(stream, sys.stdout.buffer)
    return code


def _standard_input(folder: Path, bag: Path) -> Path:
    """A bag, in place of `-` a file with what comes on the standard input."""
    if bag != _STANDARD:
        return bag
    file = folder / "standard_input.mcap"
    with file.open("wb") as stream:
        shutil.copyfileobj(sys.stdin.buffer, stream)
    return file


def _run(given: argparse.Namespace, screen: PlainScreen) -> int:
    if given.command == "info":
        return show_contents(given.bags, screen, sizes=given.sizes)
    if given.command == "check":
        return show_checks(given.bags, given.require, screen)
    if given.command == "rescue":
        return rescue_bags(given.bags, given.output, screen, doubtful=not given.verified_only)
    if given.command == "convert":
        return convert_bags(given.bags, given.output, given.compression, screen)
    if given.command == "cat":
        return print_messages(given)
    if given.command == "diff":
        return show_difference(given.bags[0], given.bags[1], screen)
    if given.command == "reindex":
        return reindex_bags(given.bags, screen)
    return cut_bags(given, screen)


def _parser() -> argparse.ArgumentParser:
    description = "Rescue, inspect and rewrite recordings."
    parser = argparse.ArgumentParser(prog="serd-bag", description=description, epilog=EXIT_CODES)
    parser.add_argument("--version", action="version", version=f"serd-bag {VERSION}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, options in COMMANDS.items():
        command = commands.add_parser(name, help=TEXTS[name], epilog=EXIT_CODES)
        n_bags = _N_BAGS.get(name, "+")
        command.add_argument("bags", metavar="BAG", nargs=n_bags, type=Path, help=TEXTS["bags"])
        for option in options.split():
            flag = f"--{option.replace('_', '-')}"
            command.add_argument(flag, help=TEXTS[option], **_KINDS[option])
    return parser


if __name__ == "__main__":
    sys.exit(main())
