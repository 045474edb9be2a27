"""`serd bag`: inspect, check, repair, convert, map and play recordings."""

from pathlib import Path
from typing import Annotated

import typer

from serd_bag.command.commands import convert_bags, recover_bags, show_checks, show_contents
from serd_bag.files import atomic_write_text
from serd_bag.formats.mcap.writer import Compression
from serd_cli.options import AsJson, add_command, arg, opt, option, require_suffix, validated
from serd_cli.output.bag_pages import RichScreen, print_suggestion, suggestion_values
from serd_cli.output.terminal import print_json
from serd_ros.settings import BagReplayConfig

Bags = Annotated[list[Path], arg("bag folders, or .mcap, .db3 or .bag files", "BAG")]
Bag = Annotated[Path, arg("bag folder, or .mcap, .db3 or .bag file", "BAG")]
Output = Annotated[Path | None, opt("folder of the new bag, which must be empty or not exist")]
Texts = list[str] | None
Required = Annotated[
    Texts, opt("topic that must have messages: /whole/name, or name in any namespace; repeat")
]
Mapping = Annotated[Path, opt("mapping file to write, ending in .yaml")]
Topics = Annotated[Texts, opt("play this one; repeat for more")]
Remap = Annotated[Texts, opt("play into another topic", metavar="FROM:=TO")]
WaitFor = Annotated[Texts, opt("start when this node subscribes", metavar="NODE")]
Clock = Annotated[bool, opt("publish bag time on /clock")]

group = typer.Typer(add_completion=False, no_args_is_help=True, suggest_commands=True)


def info(bags: Bags, as_json: AsJson = False) -> None:
    """Show what bags hold.

    serd bag info demo_output/run-1/bag

    Sound MCAP files are not read but for their summaries. Other and damaged ones are read too,
    and their faults are listed. Exit code 1 where messages of a bag are known to be lost, or where
    none of a damaged one can be read.
    """
    raise typer.Exit(show_contents(bags, RichScreen(as_json=as_json)))


def check(bags: Bags, require: Required = None, as_json: AsJson = False) -> None:
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
    compression: Annotated[Compression, opt("compression of the new bag")] = "none",
    as_json: AsJson = False,
) -> None:
    """Write any sound rosbag2 as MCAP.

    The new bag is BAG_mcap beside the old one, or --output. Messages of types not installed here
    are copied too. Exit code 1 where messages had to be left out, as those that are not CDR, 2
    where the bag is damaged.
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
    loop: bool = option(BagReplayConfig, "loop", "--loop"),
    paused: bool = option(BagReplayConfig, "paused", "--paused"),
    topic: Topics = None,
    remap: Remap = None,
    wait_for: WaitFor = None,
    wait: float = option(BagReplayConfig, "wait_s"),
    clock: Clock = True,
    as_json: AsJson = False,
) -> None:
    """Play a bag into its topics at any pace, with /clock.

    serd bag play demo_output/run-1/bag --rate 10 --wait-for learner

    Ctrl-C ends. Services pause and step, and parameter rate, of the node bag_replay steer it.
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
        paused=paused,
        required_nodes=wait_for or ("",),
        wait_s=wait,
        **({} if clock else {"clock_hz": 0.0}),
    )
    replay(settings, parse_remappings(remap or ()), as_json=as_json)


for function in (info, check, suggest, recover, convert, play):
    add_command(group, function.__name__, function)
