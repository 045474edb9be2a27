"""`serd bag play`: publishes a recording on its topics."""

import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from bags.reader import BagReader
from bags.topic import selected_topics
from serd_cli.errors import UsageError
from serd_cli.options import AsJson, option, validated
from serd_cli.output.terminal import print_json
from serd_cli.processes.node_commands import node_command
from serd_cli.processes.stack_run import require_free
from serd_cli.processes.supervisor import Process, run_together
from serd_cli.processes.workspace import ros_environment
from serd_ros.graph.configs import BagReplayConfig
from serd_ros.process.progress import VARIABLE, parse_progress

_NODE = "bag_replay"


def play(
    bag: Annotated[
        Path, typer.Argument(metavar="BAG", help="bag folder, or .mcap, .db3 or .bag file")
    ],
    rate: float = option(BagReplayConfig, "rate"),
    start: float = option(BagReplayConfig, "start_s"),
    duration: float = option(BagReplayConfig, "duration_s"),
    loop: bool = option(BagReplayConfig, "loop", "--loop"),
    paused: bool = option(BagReplayConfig, "paused", "--paused"),
    topic: Annotated[list[str] | None, typer.Option(help="play this one; repeat for more")] = None,
    remap: Annotated[
        list[str] | None, typer.Option(metavar="FROM:=TO", help="play into another topic")
    ] = None,
    wait_for: Annotated[
        list[str] | None, typer.Option(metavar="NODE", help="start when this node subscribes")
    ] = None,
    wait: float = option(BagReplayConfig, "wait_s"),
    clock: Annotated[bool, typer.Option(help="publish bag time on /clock")] = True,
    as_json: AsJson = False,
) -> None:
    """Play a bag into its topics at any pace, with /clock.

    serd bag play demo_output/run-1/bag --rate 10 --wait-for learner

    In a terminal: space pauses, right steps, up and down change the rate. Ctrl-C ends.
    With --json there are no keys.
    """
    selected_topics(BagReader(bag).topics, topic or ())
    settings = validated(
        BagReplayConfig,
        bag=str(bag.resolve()),
        topics=topic or ("",),
        rate=rate,
        start_s=start,
        duration_s=duration,
        loop=loop,
        paused=paused,
        required_nodes=wait_for or ("",),
        wait_s=wait,
        keys=sys.stdin.isatty() and sys.stderr.isatty() and not as_json,
        **({} if clock else {"clock_hz": 0.0}),
    )
    environment = ros_environment(os.environ)
    parameters = settings.model_dump(exclude_unset=True)
    remappings = _remappings(remap or ())
    command = node_command(_NODE, parameters, remappings, environment)
    if clock:
        played_clock = remappings.get("/clock", remappings.get("clock", "/clock"))
        require_free(environment, f"/{played_clock.lstrip('/')}")
    if not as_json:
        os.execve(command[0], command, environment)
    played = _Played()
    run_together([Process(_NODE, command)], environment | {VARIABLE: "1"}, played.take)
    print_json({"bag": bag.resolve(), "messages": played.n_messages})


class _Played:
    """How many messages the node reports to have played; its other lines go to stderr."""

    n_messages = 0

    def take(self, _: str, line: str) -> None:
        """Print a line of the node."""
        progress = parse_progress(line)
        if progress is None:
            print(line, file=sys.stderr, flush=True)
        elif progress.n_messages is not None:
            self.n_messages = progress.n_messages


def _remappings(pairs: list[str] | tuple[str, ...]) -> dict[str, str]:
    found = {}
    for pair in pairs:
        before, separator, after = pair.partition(":=")
        if not (before and separator and after):
            raise UsageError(f"--remap must be written FROM:=TO, got {pair!r}")
        found[before] = after
    return found
