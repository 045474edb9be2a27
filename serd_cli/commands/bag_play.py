"""`serd bag play`: publishes a recording on its topics."""

import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from bags.reader import BagReader
from bags.topic import selected_topics
from serd_cli.errors import UsageError
from serd_cli.node_commands import node_command
from serd_cli.workspace import ros_environment

_NODE = "bag_replay"


def play(
    bag: Annotated[Path, typer.Argument(metavar="BAG", help="bag folder, or .mcap or .db3 file")],
    rate: Annotated[float, typer.Option(min=1e-3, help="bag seconds per second")] = 1.0,
    start: Annotated[float, typer.Option(min=0, help="leave out the first seconds")] = 0.0,
    duration: Annotated[float, typer.Option(min=0, help="bag seconds to play; 0: all")] = 0.0,
    loop: Annotated[bool, typer.Option("--loop", help="start again at the end")] = False,
    paused: Annotated[bool, typer.Option("--paused", help="start paused")] = False,
    topic: Annotated[list[str] | None, typer.Option(help="play this one; repeat for more")] = None,
    remap: Annotated[
        list[str] | None, typer.Option(metavar="FROM:=TO", help="play into another topic")
    ] = None,
    wait_for: Annotated[
        list[str] | None, typer.Option(metavar="NODE", help="start when this node subscribes")
    ] = None,
    wait: Annotated[float, typer.Option(min=0, help="seconds to wait for any listener")] = 10.0,
    clock: Annotated[bool, typer.Option(help="publish bag time on /clock")] = True,
) -> None:
    """Play a bag into its topics at any pace, with /clock.

    serd bag play demo_output/run-1/bag --rate 10 --wait-for learner

    In a terminal: space pauses, right steps, up and down change the rate. Ctrl-C ends.
    """
    selected_topics(BagReader(bag).topics, topic or ())
    parameters = {
        "bag": str(bag.resolve()),
        "topics": topic or [""],
        "rate": rate,
        "start_s": start,
        "duration_s": duration,
        "loop": loop,
        "paused": paused,
        "required_nodes": wait_for or [""],
        "wait_s": wait,
        "keys": sys.stdin.isatty() and sys.stderr.isatty(),
    }
    if not clock:
        parameters["clock_hz"] = 0.0
    environment = ros_environment(os.environ)
    command = node_command(_NODE, parameters, _remappings(remap or ()), environment)
    os.execve(command[0], command, environment)


def _remappings(pairs: list[str] | tuple[str, ...]) -> dict[str, str]:
    found = {}
    for pair in pairs:
        before, separator, after = pair.partition(":=")
        if not (before and separator and after):
            raise UsageError(f"--remap must be written FROM:=TO, got {pair!r}")
        found[before] = after
    return found
