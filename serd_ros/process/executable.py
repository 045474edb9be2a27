"""The entry point of every installed executable: it imports and runs the node of its name.

`lib/serd_ros/hallway_sim` runs the node hallway_sim, and so does `python -m
serd_ros.process.executable hallway_sim`."""

import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from importlib import import_module
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn, TextIO

from serd_files.errors import missing_extra
from serd_files.moved_names import where_or_near

#: Exit code of a program that Ctrl-C ended, as shells have it.
INTERRUPTED = 130
#: Module in serd_ros.nodes and class of the node, by executable.
NODES = {
    "bag_replay": "bags.bag_replay:BagReplayNode",
    "demo_recorder": "bags.demo_recorder:DemoRecorderNode",
    "guard": "guard:GuardNode",
    "hallway_sim": "hallway_sim:HallwaySim",
    "learner": "learner:LearnerNode",
    "local_planner": "local_planner:LocalPlannerNode",
    "nav2_bridge": "nav2_bridge:Nav2BridgeNode",
    "people_tracker": "people_tracker:PeopleTrackerNode",
    "scripted_expert": "scripted_expert:ScriptedExpertNode",
    "strategy": "strategy:StrategyNode",
    "teleop_joy": "teleop.joy:TeleopJoyNode",
    "teleop_mux": "teleop.mux:TeleopMuxNode",
    "teleop_page": "teleop.page:TeleopPageNode",
    "watch_page": "watch_page:WatchPageNode",
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


def run(executable: str) -> NoReturn:
    """Import the node, run it and end with its exit code.

    Everything is closed then, so Python's finalisation is left out: it computes for 0.25 s.
    """
    with starting():
        if sys.stdout is None:
            sys.stdout = _nowhere(1)
        from serd_ros.process.run_node import run_node

        if executable not in NODES:  # of a workspace that an earlier version built
            near = where_or_near("executable", executable, NODES)
            print(f"there is no node {executable!r}; {near}", file=sys.stderr)
            sys.exit(2)
        try:
            node = node_maker(executable)
        except ModuleNotFoundError as error:
            if not (sentence := missing_extra(error)):
                raise
            sys.exit(f"{executable}: {sentence}")
    code = run_node(node)
    with suppress(OSError):  # who reads them may have ended
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(code)


def node_maker(executable: str) -> Callable[[], Any]:
    """What makes the node of an executable, whose name is also the node's."""
    name = NODES[executable].partition(":")[2]
    return partial(getattr(import_module(module_of(executable)), name), executable)


def module_of(executable: str) -> str:
    """The name of the module of an executable."""
    return f"serd_ros.nodes.{NODES[executable].partition(':')[0]}"


if __name__ == "__main__":
    if len(sys.argv) < 2 or sys.argv[1] not in NODES:
        sys.exit(f"serd_ros: name a node: {', '.join(NODES)}")
    run(sys.argv.pop(1))
