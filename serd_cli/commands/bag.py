"""`serd bag`: inspect, check, repair, convert and play recordings."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal

import typer

from bags.health.check import check_bag
from bags.rewrite import RewriteReport
from bags.rewrite import convert as convert_bag
from bags.rewrite import recover as recover_bag
from bags.rosbag2.layout import storage_name
from serd_cli.bag_tables import (
    bag_heading,
    check_table,
    check_values,
    info_table,
    losses,
    rewrite_heading,
    rewrite_table,
    rewrite_values,
    verdict,
)
from serd_cli.commands.bag_play import play
from serd_cli.errors import FAILED, UsageError
from serd_cli.terminal import console, print_json, progress_console

Bags = Annotated[
    list[Path], typer.Argument(metavar="BAG", help="bag folders, or .mcap or .db3 files")
]
AsJson = Annotated[bool, typer.Option("--json", help="print JSON instead of tables")]
Output = Annotated[
    Path | None, typer.Option(help="folder of the new bag, which must be empty or not exist")
]


def register(app: typer.Typer) -> None:
    """Add the subcommands."""
    group = typer.Typer(
        no_args_is_help=True,
        suggest_commands=True,
        help="Inspect, check, repair and play recordings.",
    )
    for command in (info, check, recover, convert, play):
        group.command()(command)
    app.add_typer(group, name="bag")


def info(bags: Bags, as_json: AsJson = False) -> None:
    """Show what bags hold.

    serd bag info demo_output/run-1/bag

    Damaged bags are read too, and their faults are listed.
    """
    checks = [check_bag(bag) for bag in bags]
    if as_json:
        print_json([check_values(each) for each in checks])
        return
    for each in checks:
        console.print(bag_heading(each), soft_wrap=True)
        console.print(info_table(each))
        for fault in each.faults:
            progress_console.print(fault, style="yellow", markup=False, soft_wrap=True)


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
    checks = [check_bag(bag, require or ()) for bag in bags]
    if as_json:
        print_json([check_values(each) for each in checks])
    else:
        for each in checks:
            console.print(bag_heading(each), soft_wrap=True)
            console.print(check_table(each))
            for line in verdict(each):
                console.print(line, soft_wrap=True)
    if not all(each.sound for each in checks):
        raise typer.Exit(FAILED)


def recover(bags: Bags, output: Output = None, as_json: AsJson = False) -> None:
    """Write the readable messages of a damaged bag as a new bag.

    The new bag is BAG_recovered beside the damaged one, or --output.
    The damaged bag is not changed. Exit code 1 where nothing could be read, or readable messages
    had to be left out.
    """
    reports = _rewrite(bags, output, "recovered", recover_bag)
    _show(reports, as_json)
    if any(report.n_left_out or not report.n_messages for report in reports):
        raise typer.Exit(FAILED)


def convert(
    bags: Bags,
    output: Output = None,
    compression: Annotated[
        Literal["none", "zstd"], typer.Option(help="compression of the new bag")
    ] = "none",
    as_json: AsJson = False,
) -> None:
    """Write any sound rosbag2 as MCAP.

    The new bag is BAG_mcap beside the old one, or --output. Messages of types not installed here
    are copied too. Exit code 1 where messages had to be left out, as those that are not CDR.
    """
    reports = _rewrite(
        bags,
        output,
        "mcap",
        lambda source, target: convert_bag(source, target, compression=compression),
    )
    _show(reports, as_json)
    if any(report.n_left_out for report in reports):
        raise typer.Exit(FAILED)


def _rewrite(
    bags: list[Path],
    output: Path | None,
    ending: str,
    rewrite: Callable[[Path, Path], RewriteReport],
) -> list[RewriteReport]:
    if output is not None and len(bags) > 1:
        raise UsageError(f"--output must be left out for several bags, got {output}; run each")
    return [rewrite(bag, output or _beside(bag, ending)) for bag in bags]


def _beside(bag: Path, ending: str) -> Path:
    whole = bag.resolve()
    name = Path(storage_name(whole)).stem if whole.is_file() else whole.name
    return whole.with_name(f"{name}_{ending}")


def _show(reports: list[RewriteReport], as_json: bool) -> None:
    if as_json:
        print_json([rewrite_values(report) for report in reports])
        return
    for report in reports:
        console.print(rewrite_heading(report), soft_wrap=True)
        console.print(rewrite_table(report))
        for line in losses(report):
            console.print(line, soft_wrap=True)
