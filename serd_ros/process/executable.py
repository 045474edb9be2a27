"""The entry point of every installed executable: it imports and runs the node of its name.

`lib/serd_ros/hallway_sim` runs the node hallway_sim, and so does `python -m
serd_ros.process.executable hallway_sim`."""

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from types import FrameType

from serd_ros.errors import NodeError
from serd_ros.process.parent_watch import ParentProcess

#: Exit code of a program that Ctrl-C ended, as shells have it.
INTERRUPTED = 130
#: Exit code of a node whose parent has ended or is no process.
BAD_PARENT = 2


@contextmanager
def starting() -> Iterator[None]:
    """Within it SIGINT ends the process at once; for the main thread."""
    before = signal.signal(signal.SIGINT, _end_at_once)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _end_at_once(_: int, __: FrameType | None) -> None:
    os._exit(INTERRUPTED)


def main() -> int:
    """Entry point: the node this file is named after."""
    return run(Path(sys.argv[0]).stem)


def run(node: str) -> int:
    """Import the node and run it; its exit code."""
    try:
        ParentProcess().end_process_with_parent()
    except NodeError as error:
        print(f"{node}: {error}", file=sys.stderr, flush=True)
        return BAD_PARENT
    with starting():
        module = import_module(f"serd_ros.nodes.{node}")
    return int(module.main())


if __name__ == "__main__":
    sys.exit(run(sys.argv.pop(1)))
