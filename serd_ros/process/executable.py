"""The entry point of every installed executable: it imports and runs the node of its name.

`lib/serd_ros/hallway_sim` runs the node hallway_sim, and so does `python -m
serd_ros.process.executable hallway_sim`; with --help it prints the parameters."""

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from types import FrameType
from typing import NoReturn

from serd_bag.nearest import hint
from serd_files.errors import missing_extra
from serd_files.settings import settings_of

#: Exit code of a program that Ctrl-C ended, as shells have it.
INTERRUPTED = 130


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


def main() -> NoReturn:
    """Entry point: the node this file is named after."""
    run(Path(sys.argv[0]).stem)


def _open_closed_outputs() -> None:
    """Make a closed stdout or stderr /dev/null: libraries write to them, pybullet as it loads."""
    for number, name in ((1, "stdout"), (2, "stderr")):
        if getattr(sys, name) is None:
            null = os.open(os.devnull, os.O_WRONLY)
            os.dup2(null, number)  # which may be the same, the lowest one that is free
            if null != number:
                os.close(null)
            os.set_inheritable(number, True)
            setattr(sys, name, os.fdopen(number, "w"))


def run(executable: str) -> NoReturn:
    """Import the node, run it, end with its exit code; finalisation would compute for 0.25 s."""
    with starting():
        _open_closed_outputs()
        from serd_ros.graph.graph import class_of, config_of, load_graph, module_of
        from serd_ros.process.run_node import run_node

        nodes = load_graph().nodes
        if executable not in nodes:  # of a workspace that an earlier version built
            near = hint(executable, nodes)
            print(f"there is no node {executable!r}; {near}", file=sys.stderr)
            sys.exit(2)
        try:
            node = partial(class_of(executable), executable)
        except ModuleNotFoundError as error:
            if not (sentence := missing_extra(error)):
                raise
            sys.exit(f"{executable}: {sentence}")
        if {"-h", "--help"} & {*sys.argv[1:]}:
            print(sys.modules[module_of(executable)].__doc__)
            for each in settings_of(config_of(executable)):
                print(f"  -p {each.name}:=...  {each.description}")
            sys.exit()
    code = run_node(node)
    with suppress(OSError):  # who reads them may have ended
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(code)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit("serd_ros: name a node, as guard")
    run(sys.argv.pop(1))
