"""`serd bag`: rescue, inspect, check, convert, map and play recordings."""

from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from serd_bag.command.commands import EXIT_CODES, run_command
from serd_bag.command.options import BAGS, COMMANDS, N_BAGS, OPTIONS, flags_of
from serd_bag.files import atomic_write_text
from serd_bag.quantities import counted
from serd_cli.errors import UsageError
from serd_cli.options import (
    AsJson,
    add_command,
    arg,
    opt,
    option,
    require_suffix,
    validated,
    with_parameters,
)
from serd_cli.output.terminal import console, print_json
from serd_ros.settings import BagReplayConfig

if TYPE_CHECKING:
    from serd_app.demonstrations.suggest import Suggestion

Bags = Annotated[list[Path], arg(BAGS, "BAG")]
Bag = Annotated[Path, arg(BAGS, "BAG")]
Texts = list[str] | None
Mapping = Annotated[Path, opt("mapping file to write, ending in .yaml")]
Topics = Annotated[Texts, opt("play this one; repeat for more")]
Remap = Annotated[Texts, opt("play into another topic", metavar="FROM:=TO")]
WaitFor = Annotated[Texts, opt("start when this node subscribes", metavar="NODE")]

group = typer.Typer(add_completion=False, no_args_is_help=True, suggest_commands=True)


def _add_shared(name: str) -> None:
    """Add a command of `serd-bag`, with the same options and texts."""
    names, about, more = COMMANDS[name]
    options = names.split()

    def run(bags: Bags, **given: Any) -> None:
        if name in N_BAGS and len(bags) != N_BAGS[name]:
            raise UsageError(f"{name} must have {counted(N_BAGS[name], 'BAG')}, got {len(bags)}")
        raise typer.Exit(run_command(name, SimpleNamespace(bags=bags, **given)))

    function = with_parameters(run, {each: _typed(each) for each in options})
    parts = (f"{about[0].upper()}{about[1:]}.", more, EXIT_CODES)
    add_command(group, name, function, "\n\n".join(filter(None, parts)))


def _typed(name: str) -> tuple[Any, Any]:
    """Type and default of an option that argparse reads."""
    option = OPTIONS[name]
    kind, default = option.get("type", str), option.get("default")
    found = opt(
        option["help"],
        *flags_of(name),
        metavar=option.get("metavar"),
        show_default=default == "none",
    )
    action = option.get("action")
    if action == "store_true":
        return Annotated[bool, found], False
    if action == "append":
        return Annotated[list[str] | None, found], None
    if "choices" in option:
        kind = Literal[option["choices"]]
    return Annotated[kind if default is not None else kind | None, found], default


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


for shared in COMMANDS:
    _add_shared(shared)
for function in (suggest, play):
    add_command(group, function.__name__, function)
