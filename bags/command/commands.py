"""The commands, on any screen. Each returns its exit code: 1 where a bag is not sound or whole."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, Literal, Protocol, TypeVar

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
from bags.health.check import BagCheck, check_bag
from bags.health.contents import BagContents, contents_of_bag

FAILED = 1
Compression = Literal["none", "zstd"]
Result = TypeVar("Result")


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

    def show(contents: BagContents) -> None:
        screen.heading(bag_heading(contents))
        screen.table(contents_table(contents))
        for fault in contents.faults:
            screen.remark(fault)

    _shown(map(contents_of_bag, bags), show, contents_values, screen)
    return 0


def show_checks(bags: Sequence[Path], required: Sequence[str], screen: Screen) -> int:
    """`check`: read bags completely and list their faults."""

    def show(check: BagCheck) -> None:
        screen.heading(bag_heading(check))
        screen.table(check_table(check))
        for line in verdict(check):
            screen.line(line)

    found = (check_bag(bag, required) for bag in bags)
    checks = _shown(found, show, check_values, screen)
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

    def show(report: RewriteReport) -> None:
        screen.heading(rewrite_heading(report))
        screen.table(rewrite_table(report))
        for line in loss_lines(report):
            screen.line(line)

    reports = (rewrite(bag, output or _beside(bag, ending)) for bag in bags)
    return _shown(reports, show, rewrite_values, screen)


def _shown(
    found: Iterable[Result],
    show: Callable[[Result], None],
    values_of: Callable[[Result], dict[str, Any]],
    screen: Screen,
) -> list[Result]:
    """All results; each is shown before the next bag is read, which may fail."""
    results = []
    for each in found:
        results.append(each)
        if not screen.as_json:
            show(each)
    if screen.as_json:
        screen.values([values_of(each) for each in results])
    return results


def _beside(bag: Path, ending: str) -> Path:
    whole = bag.resolve()
    name = Path(storage_name(whole)).stem if whole.is_file() else whole.name
    return whole.with_name(f"{name}_{ending}")
