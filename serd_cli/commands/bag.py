"""`serd bag`: inspect, check, repair, convert and play recordings."""

from collections.abc import Callable, Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from rich.console import RenderableType
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from bags.health.check import BagCheck, check_bag
from bags.health.contents import BagContents, contents_of_bag
from bags.health.topic_check import TopicCheck
from bags.rewrite import RewriteReport
from bags.rewrite import convert as convert_bag
from bags.rewrite import recover as recover_bag
from bags.rosbag2.layout import storage_name
from report.style import counted, seconds_in_words
from serd_cli.commands.bag_play import play
from serd_cli.commands.bag_suggest import suggest
from serd_cli.errors import FAILED, UsageError
from serd_cli.options import AsJson
from serd_cli.output.terminal import console, print_json, progress_console

Bags = Annotated[
    list[Path], typer.Argument(metavar="BAG", help="bag folders, or .mcap or .db3 files")
]
Output = Annotated[
    Path | None, typer.Option(help="folder of the new bag, which must be empty or not exist")
]


#: Of a column of names: rich narrows these first where the table is wider than the terminal.
_LEAST_TEXT_WIDTH = 12
#: Longer ones are those of another clock, of which digits after the point state nothing.
_LONG_DELAY_S = 100.0


def register(app: typer.Typer) -> None:
    """Add the subcommands."""
    group = typer.Typer(
        no_args_is_help=True,
        suggest_commands=True,
        help="Inspect, check, repair and play recordings.",
    )
    for command in (info, check, suggest, recover, convert, play):
        group.command()(command)
    app.add_typer(group, name="bag")


def info(bags: Bags, as_json: AsJson = False) -> None:
    """Show what bags hold.

    serd bag info demo_output/run-1/bag

    Sound MCAP files are not read but for their summaries. Other and damaged ones are read too,
    and their faults are listed.
    """
    found = [contents_of_bag(bag) for bag in bags]
    if as_json:
        print_json([{**asdict(each), "n_messages": each.n_messages} for each in found])
        return
    for each in found:
        console.print(_bag_heading(each, each.span_s), soft_wrap=True)
        console.print(_info_table(each))
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
        print_json([_check_values(each) for each in checks])
    else:
        for each in checks:
            console.print(_bag_heading(each, each.span_s), soft_wrap=True)
            console.print(_check_table(each))
            for line in _verdict(each):
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
        print_json([_rewrite_values(report) for report in reports])
        return
    for report in reports:
        console.print(_rewrite_heading(report), soft_wrap=True)
        console.print(_rewrite_table(report))
        for line in _loss_lines(report):
            console.print(line, soft_wrap=True)


def _bag_heading(found: BagCheck | BagContents, span_s: float) -> Text:
    """The line above the table of a bag."""
    n_filled = sum(topic.n_messages > 0 for topic in found.topics)
    if not n_filled:
        return Text(f"{found.path}: no message")
    messages, topics = counted(found.n_messages, "message"), counted(n_filled, "topic")
    return Text(f"{found.path}: {messages} on {topics} in {seconds_in_words(span_s)}")


def _rewrite_heading(report: RewriteReport) -> Text:
    """The line above the table of a new bag."""
    messages = counted(report.n_messages, "message")
    left_out = f", {report.n_left_out} left out" if report.n_left_out else ""
    return Text(f"{report.source} -> {report.target}: {messages}{left_out}")


def _info_table(found: BagContents) -> Table:
    """One row per topic: type, messages and rate."""
    table = _table(("topic", "type"), ("messages", "mean\nHz"))
    for topic in found.topics:
        numbers = str(topic.n_messages), _rate(topic.mean_hz)
        table.add_row(escape(topic.name), escape(topic.type_name), *numbers)
    return table


def _check_table(found: BagCheck) -> Table:
    """One row per topic: rates, gaps and the two clocks."""
    columns = (
        *("messages", "mean\nHz", "usual\nHz"),
        *("longest\ngap [s]", "gaps", "log time -\nstamp [s]"),
    )
    table = _table(("topic",), columns)
    for topic in found.topics:
        table.add_row(
            escape(topic.name),
            str(topic.n_messages),
            _rate(topic.mean_hz),
            _rate(topic.rate_hz),
            f"{topic.longest_gap_s:.2f}",
            str(topic.n_gaps),
            _delay(topic),
        )
    return table


def _verdict(found: BagCheck) -> Iterable[RenderableType]:
    """Faults, remarks and one last line."""
    yield from (Text(f"fault: {fault}", style="red") for fault in found.faults)
    yield from (Text(f"note: {remark}", style="yellow") for remark in found.remarks)
    if found.sound:
        yield Text(f"sound: {found.path}", style="green")
    else:
        yield Text(f"not sound: {found.path} ({counted(len(found.faults), 'fault')})", style="red")


def _rewrite_table(report: RewriteReport) -> Table:
    """One row per topic of the new bag, and per topic left out with the reason."""
    table = _table(("topic",), ("messages",))
    if report.skipped:
        table.add_column("left out because", overflow="fold")
    for name, count in sorted(report.counts.items()):
        table.add_row(escape(name), str(count))
    for name, reason in sorted(report.skipped.items()):
        table.add_row(escape(name), f"0 of {report.left_out[name]}", escape(reason))
    return table


def _loss_lines(report: RewriteReport) -> Iterable[RenderableType]:
    """The damage found, and the messages lost by it."""
    yield from (Text(f"damage: {damage}", style="yellow") for damage in report.damage)
    if report.n_lost is None:
        yield Text("messages lost: unknown, the damaged bag has no count", style="yellow")
    elif report.damage:
        at_least = "" if report.all_lost_known else "at least "
        yield Text(f"messages lost: {at_least}{report.n_lost}", style="yellow")


def _check_values(found: BagCheck) -> dict[str, Any]:
    """All results of a check."""
    return {**asdict(found), "sound": found.sound, "n_messages": found.n_messages}


def _rewrite_values(report: RewriteReport) -> dict[str, Any]:
    """All values of the report."""
    sums = {"n_messages": report.n_messages, "n_left_out": report.n_left_out}
    return {**asdict(report), **sums}


def _rate(hz: float | None) -> str:
    """At least three digits: map and marks are sent less than once a second."""
    if hz is None:
        return "-"
    return f"{hz:.1f}" if hz >= 1 else f"{hz:.3f}"


def _delay(topic: TopicCheck) -> str:
    if topic.stamp_delay_s is None:
        return "no stamps"
    return "…".join(map(_seconds, topic.stamp_delay_s))


def _seconds(delay_s: float) -> str:
    return f"{delay_s:.3f}" if abs(delay_s) < _LONG_DELAY_S else f"{delay_s:.3g}"


def _table(texts: Iterable[str], numbers: Iterable[str]) -> Table:
    table = Table()
    for name in texts:
        table.add_column(escape(name), overflow="fold", min_width=_LEAST_TEXT_WIDTH)
    for name in numbers:
        table.add_column(escape(name), justify="right", no_wrap=True)
    return table
