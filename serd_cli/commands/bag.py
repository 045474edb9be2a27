"""`serd bag`: rescue, inspect, check, convert, map and play recordings."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table as RichTable
from rich.text import Text

from serd_bag.command.commands import Page, convert_bags, rescue_bags, show_checks, show_contents
from serd_bag.command.texts import TEXTS
from serd_bag.errors import printable
from serd_bag.files import atomic_write_text
from serd_bag.formats.mcap.writer import Compression
from serd_bag.quantities import counted
from serd_cli.options import AsJson, add_command, arg, opt, option, require_suffix, validated
from serd_cli.output.terminal import console, print_json, progress_console
from serd_ros.settings import BagReplayConfig

if TYPE_CHECKING:
    from serd_app.demonstrations.suggest import Suggestion

Bags = Annotated[list[Path], arg(TEXTS["bags"], "BAG")]
Bag = Annotated[Path, arg(TEXTS["bags"], "BAG")]
Output = Annotated[Path | None, opt(TEXTS["output"])]
Texts = list[str] | None
Required = Annotated[Texts, opt(TEXTS["require"])]
Mapping = Annotated[Path, opt("mapping file to write, ending in .yaml")]
Topics = Annotated[Texts, opt("play this one; repeat for more")]
Remap = Annotated[Texts, opt("play into another topic", metavar="FROM:=TO")]
WaitFor = Annotated[Texts, opt("start when this node subscribes", metavar="NODE")]

group = typer.Typer(add_completion=False, no_args_is_help=True, suggest_commands=True)


def info(
    bags: Bags,
    sizes: Annotated[bool, opt(TEXTS["sizes"], "--sizes")] = False,
    as_json: AsJson = False,
) -> None:
    """Show what bags hold.

    serd bag info demo_output/run-1/bag

    Sound MCAP files are not read but for their summaries. Other and damaged ones are read too,
    and their faults are listed. Exit code 1 where messages of a bag are known to be lost, or where
    none of a damaged one can be read.
    """
    raise typer.Exit(show_contents(bags, RichScreen(as_json=as_json), sizes=sizes))


def check(bags: Bags, require: Required = None, as_json: AsJson = False) -> None:
    """Read bags completely and list their faults.

    serd bag check BAG --require robot_pose --require intent

    Exit code 1 where a bag is damaged or lacks a required topic.
    """
    raise typer.Exit(show_checks(bags, require or (), RichScreen(as_json=as_json)))


def rescue(
    bags: Bags,
    output: Output = None,
    verified_only: Annotated[bool, opt(TEXTS["verified_only"], "--verified-only")] = False,
    as_json: AsJson = False,
) -> None:
    """Save every whole message of a broken recording, or of any bytes that hold some.

    serd bag rescue BAG

    The new bag is BAG_rescued beside the broken one, or --output, with a certificate of what was
    lost. The broken one is not changed. Exit code 0 where nothing was lost, 1 where something was
    or may be, 2 where nothing can be read.
    """
    screen = RichScreen(as_json=as_json)
    raise typer.Exit(rescue_bags(bags, output, screen, doubtful=not verified_only))


def convert(
    bags: Bags,
    output: Output = None,
    compression: Annotated[Compression, opt(TEXTS["compression"])] = "none",
    as_json: AsJson = False,
) -> None:
    """Write any sound bag as MCAP of ROS 2.

    The new bag is BAG_mcap beside the old one, or --output. Messages of ROS 1 become those of ROS 2
    with the same fields, all others stay as they are. Exit code 2 where the bag is damaged.
    """
    raise typer.Exit(convert_bags(bags, output, compression, RichScreen(as_json=as_json)))


def suggest(bag: Bag, output: Mapping = Path("mapping.yaml"), as_json: AsJson = False) -> None:
    """Write a mapping file for 'serd demos' from the topics of a bag of another robot.

    serd bag suggest BAG --output mapping.yaml

    Poses and velocity commands are found by type and name, and tested against each other: how long
    does the robot follow a command, after what delay, and how often do command and motion disagree?
    Where commands do not explain the motion, the motion is the action. The file states as comments
    what was found and assumed.
    """
    require_suffix(output, ".yaml")
    from serd_app.demonstrations.suggest import suggest_mapping

    found = suggest_mapping(bag)
    text = found.yaml(output)
    atomic_write_text(output, text)
    if as_json:
        print_json(suggestion_values(found, bag, output))
    else:
        print_suggestion(found, text, output)


def play(
    bag: Bag,
    rate: float = option(BagReplayConfig, "rate"),
    start: float = option(BagReplayConfig, "start_s"),
    duration: float = option(BagReplayConfig, "duration_s"),
    loop: bool = option(BagReplayConfig, "loop"),
    topic: Topics = None,
    remap: Remap = None,
    wait_for: WaitFor = None,
) -> None:
    """Play a bag into its topics at any pace.

    serd bag play demo_output/run-1/bag --rate 10 --wait-for learner

    Ctrl-C ends.
    """
    from serd_cli.processes.stack_run import parse_remappings, replay

    settings = validated(
        BagReplayConfig,
        bag=str(bag.resolve()),
        topics=topic or ("",),
        rate=rate,
        start_s=start,
        duration_s=duration,
        loop=loop,
        required_nodes=wait_for or ("",),
    )
    replay(settings, parse_remappings(remap or ()))


#: Of a column of names: rich narrows these first where the table is wider than the terminal.
_LEAST_TEXT_WIDTH = 12
_COLOURS = {"good": "green", "notable": "yellow", "bad": "red"}


def print_suggestion(found: "Suggestion", text: str, output: Path) -> None:
    """The mapping file, what it gives, and the command to use it with."""
    console.print(text, soft_wrap=True)
    if (report := found.report) is not None:
        console.print(
            f"on cells of {found.cell_size_m:g} m: {counted(report.n_decisions, 'decision')},"
            f" {report.n_censored} of them without outcome, {report.n_moving_waits} waits"
            " while the robot moves",
            soft_wrap=True,
        )
    console.print(f"mapping: {output.resolve()}", soft_wrap=True)
    console.print(f"next: {found.command(output)}", soft_wrap=True)


def suggestion_values(found: "Suggestion", bag: Path, output: Path) -> dict[str, Any]:
    """The same by name."""
    report = None if found.report is None else found.report.model_dump()
    values = {"bag": bag, "mapping": found.mapping.model_dump(mode="json")}
    return {**values, "comments": found.comments, "report": report, "file": output}


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
        for number, name in enumerate(page.columns):
            if number in page.texts:
                shown.add_column(name, overflow="fold", min_width=_LEAST_TEXT_WIDTH)
            else:
                shown.add_column(name, justify="right", no_wrap=True)
        for row in page.rows:
            shown.add_row(*map(printable, row))
        console.print(shown)
        for style, sentence in page.lines:
            console.print(Text(printable(sentence), style=_COLOURS[style]), soft_wrap=True)
        for remark in page.remarks:
            progress_console.print(remark, style="yellow", soft_wrap=True)


for function in (info, check, suggest, rescue, convert, play):
    add_command(group, function.__name__, function)
