"""The output of `serd bag`: tables for the terminal, plain values for JSON."""

from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

from rich.console import RenderableType
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from bags.health.check import BagCheck
from bags.health.topic_check import TopicCheck
from bags.rewrite import RewriteReport
from report.style import counted, seconds_in_words


def bag_heading(check: BagCheck) -> Text:
    """The line above the table of a bag."""
    filled = [topic for topic in check.topics if topic.n_messages]
    if not filled:
        return Text(f"{check.path}: no message")
    span_s = max(topic.last_s for topic in filled) - min(topic.first_s for topic in filled)
    messages, topics = counted(check.n_messages, "message"), counted(len(filled), "topic")
    return Text(f"{check.path}: {messages} on {topics} in {seconds_in_words(span_s)}")


def rewrite_heading(report: RewriteReport) -> Text:
    """The line above the table of a new bag."""
    messages = counted(report.n_messages, "message")
    left_out = f", {report.n_left_out} left out" if report.n_left_out else ""
    return Text(f"{report.source} -> {report.target}: {messages}{left_out}")


def info_table(check: BagCheck) -> Table:
    """One row per topic: type, messages and rates."""
    table = _table(("topic", "type"), ("messages", "mean\nHz", "usual\nHz"))
    for topic in check.topics:
        numbers = str(topic.n_messages), _rate(topic.mean_hz), _rate(topic.rate_hz)
        table.add_row(escape(topic.name), escape(topic.type_name), *numbers)
    return table


def check_table(check: BagCheck) -> Table:
    """One row per topic: rates, gaps and the two clocks."""
    columns = (
        *("messages", "mean\nHz", "usual\nHz"),
        *("longest\ngap [s]", "gaps", "log time -\nstamp [s]"),
    )
    table = _table(("topic",), columns)
    for topic in check.topics:
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


def verdict(check: BagCheck) -> Iterable[RenderableType]:
    """Faults, remarks and one last line."""
    yield from (Text(f"fault: {fault}", style="red") for fault in check.faults)
    yield from (Text(f"note: {remark}", style="yellow") for remark in check.remarks)
    if check.sound:
        yield Text(f"sound: {check.path}", style="green")
    else:
        yield Text(f"not sound: {check.path} ({counted(len(check.faults), 'fault')})", style="red")


def rewrite_table(report: RewriteReport) -> Table:
    """One row per topic of the new bag, and of those left out why."""
    table = _table(("topic",), ("messages",))
    if report.skipped:
        table.add_column("left out because", overflow="fold")
    for name, count in sorted(report.counts.items()):
        table.add_row(escape(name), str(count))
    for name, reason in sorted(report.skipped.items()):
        table.add_row(escape(name), f"0 of {report.left_out[name]}", escape(reason))
    return table


def losses(report: RewriteReport) -> Iterable[RenderableType]:
    """The damage met on the way, and what it cost."""
    yield from (Text(f"damage: {sentence}", style="yellow") for sentence in report.damage)
    if report.n_lost is None:
        yield Text("messages lost: unknown, the damaged bag has no count", style="yellow")
    elif report.damage:
        at_least = "" if report.all_lost_known else "at least "
        yield Text(f"messages lost: {at_least}{report.n_lost}", style="yellow")


def check_values(check: BagCheck) -> dict[str, Any]:
    """The whole check."""
    return {**asdict(check), "sound": check.sound, "n_messages": check.n_messages}


def rewrite_values(report: RewriteReport) -> dict[str, Any]:
    """The whole report."""
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
    least, greatest = topic.stamp_delay_s
    return f"{least:.3f}…{greatest:.3f}"


def _table(texts: Iterable[str], numbers: Iterable[str]) -> Table:
    table = Table()
    for name in texts:
        table.add_column(escape(name), overflow="fold")
    for name in numbers:
        table.add_column(escape(name), justify="right", no_wrap=True)
    return table
