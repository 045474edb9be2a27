"""Progress of a node for the command that started it: one line of JSON on stderr per report.

A command that shows progress sets the environment variable `SERD_PROGRESS`; without it a node
writes no such lines.
"""

import os
import sys
from collections.abc import Mapping

from pydantic import ValidationError

from storage.yaml_config import StrictModel

VARIABLE = "SERD_PROGRESS"
_MARK = "serd-progress "


class Progress(StrictModel):
    """done: finished parts, None when unknown; text: what the node does now."""

    text: str
    done: int | None = None


def write_progress(progress: Progress, environment: Mapping[str, str] = os.environ) -> None:
    """Write the line where the command wants it."""
    if environment.get(VARIABLE):
        print(_MARK + progress.model_dump_json(), file=sys.stderr, flush=True)


def parse_progress(line: str) -> Progress | None:
    """The progress in a line that a node wrote, None where it is any other line."""
    if not line.startswith(_MARK):
        return None
    try:
        return Progress.model_validate_json(line.removeprefix(_MARK))
    except ValidationError:
        return None
