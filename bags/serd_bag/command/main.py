"""`serd-bag`: rescue, inspect, check, cut, merge and compare recordings, without ROS.

Exit codes: `EXIT_CODES` of the commands, 130 interrupted.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from serd_bag.command.commands import BAD_INPUT, EXIT_CODES, run_command
from serd_bag.command.options import BAGS, COMMANDS, N_BAGS, OPTIONS, flags_of
from serd_bag.errors import FileError
from serd_bag.standard_output import written_output

INTERRUPTED = 130
VERSION = "0.4.0"


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point."""
    exit_code = 0
    try:
        with written_output():
            given = _parser().parse_args(arguments)
            exit_code = run_command(given.command, given)
    except FileError as error:
        print(f"serd-bag: {error}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        return INTERRUPTED
    return exit_code


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
            command.add_argument(*flags_of(option), dest=option, **OPTIONS[option])
    return parser


if __name__ == "__main__":
    sys.exit(main())
