"""What a node reports to the command that started it: one line of JSON on stderr per report.

A command that takes reports sets the environment variable `SERD_PROGRESS`; without it a node
writes no such lines.
"""

import os
import sys
from collections.abc import Callable

from pydantic import ValidationError

from serd_files.yaml_config import StrictModel

VARIABLE = "SERD_PROGRESS"
_MARK = "serd-progress "


class Progress(StrictModel):
    """done: finished parts, None when unknown; text: what the node does now.

    address: URL of the page that the node serves.
    """

    text: str
    done: int | None = None
    address: str = ""


def write_progress(progress: Progress) -> bool:
    """Write the line where the command reads it; returns whether it does."""
    wanted = bool(os.environ.get(VARIABLE))
    if wanted:
        print(_MARK + progress.model_dump_json(), file=sys.stderr, flush=True)
    return wanted


def report_address(address: str, log: Callable[[str], object]) -> None:
    """Give the address of a page to the command that started the node, or else to the log."""
    progress = Progress(text=f"the page is at {address}", address=address)
    if not write_progress(progress):
        log(progress.text)


def parse_progress(line: str) -> Progress | None:
    """The progress in a line that a node wrote, None where it is any other line."""
    if not line.startswith(_MARK):
        return None
    try:
        return Progress.model_validate_json(line.removeprefix(_MARK))
    except ValidationError:
        return None
