"""The entry point of every installed executable: it imports and runs the node of its name.

`lib/serd_ros/hallway_sim` runs the node hallway_sim, and so does `python -m
serd_ros.process.executable hallway_sim`."""

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from types import FrameType
from typing import NoReturn, TextIO

#: Exit code of a program that Ctrl-C ended, as shells have it.
INTERRUPTED = 130
#: Nodes that are in packages of serd_ros.nodes, by executable; others are modules of their name.
_IN_PACKAGES = {
    "bag_replay": "bags.bag_replay",
    "demo_recorder": "bags.demo_recorder",
    "teleop_joy": "teleop.joy",
    "teleop_keyboard": "teleop.keyboard",
    "teleop_mux": "teleop.mux",
    "teleop_page": "teleop.page",
}


@contextmanager
def starting() -> Iterator[None]:
    """Within it SIGINT ends the process at once; for the main thread.

    A closed stderr is /dev/null: libraries write to it, and pybullet could not be imported.
    """
    if sys.stderr is None:
        sys.stderr = _nowhere(2)
    before = signal.signal(signal.SIGINT, _end_at_once)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _nowhere(descriptor: int) -> TextIO:
    null = os.open(os.devnull, os.O_WRONLY)
    if null == descriptor:  # the lowest one that is free
        os.set_inheritable(descriptor, True)
    else:
        os.dup2(null, descriptor)
        os.close(null)
    return os.fdopen(descriptor, "w")


def _end_at_once(_: int, __: FrameType | None) -> None:
    os._exit(INTERRUPTED)


def main() -> NoReturn:
    """Entry point: the node this file is named after."""
    run(Path(sys.argv[0]).stem)


def run(node: str) -> NoReturn:
    """Import the node, run it and end with its exit code.

    Everything is closed then, so Python's finalisation is left out: it computes for 0.25 s.
    """
    with starting():
        if sys.stdout is None:
            sys.stdout = _nowhere(1)
        module = import_module(module_of(node))
    code = int(module.main())
    with suppress(OSError):  # who reads them may have ended
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(code)


def module_of(node: str) -> str:
    """The name of the module with the `main` of an executable."""
    return f"serd_ros.nodes.{_IN_PACKAGES.get(node, node)}"


if __name__ == "__main__":
    run(sys.argv.pop(1))
