"""`serd bag`: inspect, check, repair, convert, map and play recordings."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table as RichTable
from rich.text import Text

from serd_app.demonstrations.discretise import DiscretisationReport
from serd_app.demonstrations.suggestion.suggest import Suggestion, suggest_mapping
from serd_bag.command.commands import (
    Page,
    convert_bags,
    recover_bags,
    show_checks,
    show_contents,
)
from serd_bag.files import atomic_write_text
from serd_bag.formats.mcap.writer import Compression
from serd_bag.quantities import counted
from serd_bag.reader import BagReader
from serd_bag.topic import selected_topics
from serd_cli.errors import UsageError
from serd_cli.options import AsJson, option, require_suffix, validated
from serd_cli.output.terminal import console, print_json, progress_console
from serd_cli.processes.node_commands import node_command
from serd_cli.processes.stack_run import require_free, run_alone
from serd_cli.processes.workspace import ros_environment
from serd_ros.settings import BagReplayConfig

Bags = Annotated[
    list[Path], typer.Argument(metavar="BAG", help="bag folders, or .mcap, .db3 or .bag files")
]
Output = Annotated[
    Path | None, typer.Option(help="folder of the new bag, which must be empty or not exist")
]

#: Of a column of names: rich narrows these first where the table is wider than the terminal.
_LEAST_TEXT_WIDTH = 12
_NODE = "bag_replay"
_COLOURS = {"good": "green", "notable": "yellow", "bad": "red"}


group = typer.Typer(
    no_args_is_help=True, suggest_commands=True, help="Inspect, check, repair and play recordings."
)


def info(bags: Bags, as_json: AsJson = False) -> None:
    """Show what bags hold.

    serd bag info demo_output/run-1/bag

    Sound MCAP files are not read but for their summaries. Other and damaged ones are read too,
    and their faults are listed. Exit code 1 where messages of a bag are known to be lost, or where
    none of a damaged one can be read.
    """
    raise typer.Exit(show_contents(bags, RichScreen(as_json=as_json)))


def check(
    bags: Bags,
    require: Annotated[
        list[str] | None,
        typer.Option(
            help="topic that must have messages: /whole/name, or name in any namespace; repeat"
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Read bags completely and list their faults.

    serd bag check BAG --require robot_pose --require intent

    Exit code 1 where a bag is damaged or lacks a required topic.
    """
    raise typer.Exit(show_checks(bags, require or (), RichScreen(as_json=as_json)))


def recover(bags: Bags, output: Output = None, as_json: AsJson = False) -> None:
    """Write the readable messages of a damaged bag as a new bag.

    The new bag is BAG_recovered beside the damaged one, or --output.
    The damaged bag is not changed. Exit code 0 where no message is known to be missing from the
    new bag, 1 where messages are known to be lost or had to be left out, 3 where none of a damaged
    bag could be read.
    """
    raise typer.Exit(recover_bags(bags, output, RichScreen(as_json=as_json)))


def convert(
    bags: Bags,
    output: Output = None,
    compression: Annotated[Compression, typer.Option(help="compression of the new bag")] = "none",
    as_json: AsJson = False,
) -> None:
    """Write any sound rosbag2 as MCAP.

    The new bag is BAG_mcap beside the old one, or --output. Messages of types not installed here
    are copied too. Exit code 1 where messages had to be left out, as those that are not CDR, 2
    where the bag is damaged.
    """
    raise typer.Exit(convert_bags(bags, output, compression, RichScreen(as_json=as_json)))


def suggest(
    bag: Annotated[Path, typer.Argument(metavar="BAG", help="bag folder, or file of one")],
    output: Annotated[Path, typer.Option(help="mapping file to write, ending in .yaml")] = Path(
        "mapping.yaml"
    ),
    as_json: AsJson = False,
) -> None:
    """Write a mapping file for 'serd demos' from the topics of a bag of another robot.

    serd bag suggest BAG --output mapping.yaml

    Poses and velocity commands are found by type and name, and tested against each other: how long
    does the robot follow a command, after what delay, and how often do command and motion disagree?
    Where commands do not explain the motion, the motion is the action. The file states as comments
    what was found and assumed.
    """
    require_suffix(output, ".yaml")
    found = suggest_mapping(bag)
    text = found.yaml(output)
    atomic_write_text(output, text)
    if as_json:
        report = None if found.report is None else found.report.model_dump()
        values = {"bag": bag, "mapping": found.mapping.model_dump(mode="json")}
        print_json({**values, "comments": found.comments, "report": report, "file": output})
        return
    console.print(text, soft_wrap=True)
    if found.report is not None:
        console.print(_given(found, found.report), soft_wrap=True)
    console.print(f"mapping: {output.resolve()}", soft_wrap=True)
    console.print(f"next: {found.command(output)}", soft_wrap=True)


def _given(found: Suggestion, report: DiscretisationReport) -> str:
    """What the mapping gives."""
    return (
        f"on cells of {found.cell_size_m:g} m: {counted(report.n_decisions, 'decision')},"
        f" {report.n_censored} of them without outcome, {report.n_moving_waits} waits"
        " while the robot moves"
    )


class RichScreen:
    """Prints in colours, tables with borders."""

    def __init__(self, *, as_json: bool) -> None:
        self.as_json = as_json

    def values(self, values: list[dict[str, Any]]) -> None:
        """All results as JSON."""
        print_json(values)

    def show(self, page: Page) -> None:
        """A table whose names are folded first where it is wider than the terminal, sentences in
        the colours of their styles; remarks on stderr."""
        console.print(Text(page.heading), soft_wrap=True)
        shown = RichTable()
        for number, name in enumerate(page.table.columns):
            if number in page.table.texts:
                shown.add_column(name, overflow="fold", min_width=_LEAST_TEXT_WIDTH)
            else:
                shown.add_column(name, justify="right", no_wrap=True)
        for row in page.table.rows:
            shown.add_row(*row)
        console.print(shown)
        for line in page.lines:
            console.print(Text(line.text, style=_COLOURS[line.style]), soft_wrap=True)
        for remark in page.remarks:
            progress_console.print(remark, style="yellow", soft_wrap=True)


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

    Ctrl-C ends. The services pause and step of the node bag_replay, and its parameter rate, steer
    it meanwhile.
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
    played = [0]
    run_alone(_NODE, command, environment, lambda progress: played.append(progress.n_messages or 0))
    print_json({"bag": bag.resolve(), "messages": max(played)})


def _remappings(pairs: Sequence[str]) -> dict[str, str]:
    found = {}
    for pair in pairs:
        before, separator, after = pair.partition(":=")
        if not (before and separator and after):
            raise UsageError(f"--remap must be written FROM:=TO, got {pair!r}")
        found[before] = after
    return found


for each in (info, check, suggest, recover, convert, play):
    group.command()(each)
