"""The commands, on any screen. Each returns its exit code: 1 where a bag is not sound or whole."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal, Protocol

from bags.command.results import (
    Line,
    Table,
    bag_heading,
    check_table,
    check_values,
    contents_table,
    contents_values,
    loss_lines,
    rewrite_heading,
    rewrite_table,
    rewrite_values,
    verdict,
)
from bags.command.rewrite import RewriteReport, convert, recover
from bags.errors import BagError
from bags.formats.rosbag2.layout import storage_name
from bags.health.check import check_bag
from bags.health.contents import contents_of_bag

FAILED = 1
Compression = Literal["none", "zstd"]


class Screen(Protocol):
    """Where results go; as_json: values in place of tables and sentences."""

    as_json: bool

    def values(self, values: list[dict[str, Any]]) -> None:
        """All results as JSON."""

    def heading(self, text: str) -> None:
        """The line above a table."""

    def table(self, table: Table) -> None:
        """A table."""

    def line(self, line: Line) -> None:
        """A sentence."""

    def remark(self, text: str) -> None:
        """A sentence apart from the results."""


def show_contents(bags: Sequence[Path], screen: Screen) -> int:
    """`info`: what bags hold."""
    found = [contents_of_bag(bag) for bag in bags]
    if screen.as_json:
        screen.values([contents_values(each) for each in found])
        return 0
    for each in found:
        screen.heading(bag_heading(each))
        screen.table(contents_table(each))
        for fault in each.faults:
            screen.remark(fault)
    return 0


def show_checks(bags: Sequence[Path], required: Sequence[str], screen: Screen) -> int:
    """`check`: read bags completely and list their faults."""
    checks = [check_bag(bag, required) for bag in bags]
    if screen.as_json:
        screen.values([check_values(each) for each in checks])
    else:
        for each in checks:
            screen.heading(bag_heading(each))
            screen.table(check_table(each))
            for line in verdict(each):
                screen.line(line)
    return 0 if all(each.sound for each in checks) else FAILED


def recover_bags(bags: Sequence[Path], output: Path | None, screen: Screen) -> int:
    """`recover`: write the readable messages of damaged bags as new bags."""
    reports = _rewritten(bags, output, "recovered", recover, screen)
    return FAILED if any(each.n_left_out or not each.n_messages for each in reports) else 0


def convert_bags(
    bags: Sequence[Path], output: Path | None, compression: Compression, screen: Screen
) -> int:
    """`convert`: write sound bags as MCAP."""

    def rewrite(source: Path, target: Path) -> RewriteReport:
        return convert(source, target, compression=compression)

    reports = _rewritten(bags, output, "mcap", rewrite, screen)
    return FAILED if any(each.n_left_out for each in reports) else 0


def _rewritten(
    bags: Sequence[Path],
    output: Path | None,
    ending: str,
    rewrite: Callable[[Path, Path], RewriteReport],
    screen: Screen,
) -> list[RewriteReport]:
    if output is not None and len(bags) > 1:
        raise BagError(f"--output must be left out for several bags, got {output}; run each")
    reports = [rewrite(bag, output or _beside(bag, ending)) for bag in bags]
    if screen.as_json:
        screen.values([rewrite_values(each) for each in reports])
        return reports
    for report in reports:
        screen.heading(rewrite_heading(report))
        screen.table(rewrite_table(report))
        for line in loss_lines(report):
            screen.line(line)
    return reports


def _beside(bag: Path, ending: str) -> Path:
    whole = bag.resolve()
    name = Path(storage_name(whole)).stem if whole.is_file() else whole.name
    return whole.with_name(f"{name}_{ending}")
