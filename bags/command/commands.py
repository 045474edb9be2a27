"""The commands, on any screen. Each returns its exit code: 1 where a bag is not sound or whole."""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Literal, Protocol, TypeVar

from bags.command.results import Page, check_page, contents_page, rewrite_page
from bags.command.rewrite import RewriteReport, convert, recover
from bags.errors import BagError
from bags.formats.rosbag2.layout import storage_name
from bags.health.check import check_bag
from bags.health.contents import contents_of_bag

FAILED = 1
Compression = Literal["none", "zstd"]
Result = TypeVar("Result")


class Screen(Protocol):
    """Where results go; as_json: as values in place of pages."""

    as_json: bool

    def values(self, values: list[dict[str, Any]]) -> None:
        """All results as JSON."""

    def show(self, page: Page) -> None:
        """The result for one bag."""


def show_contents(bags: Sequence[Path], screen: Screen) -> int:
    """`info`: what bags hold."""
    _shown(map(contents_of_bag, bags), contents_page, screen)
    return 0


def show_checks(bags: Sequence[Path], required: Sequence[str], screen: Screen) -> int:
    """`check`: read bags completely and list their faults."""
    checks = _shown((check_bag(bag, required) for bag in bags), check_page, screen)
    return 0 if all(each.sound for each in checks) else FAILED


def recover_bags(bags: Sequence[Path], output: Path | None, screen: Screen) -> int:
    """`recover`: write the readable messages of damaged bags as new bags."""
    reports = _rewritten(bags, output, "recovered", recover, screen)
    return FAILED if any(each.n_left_out or not each.n_messages for each in reports) else 0


def convert_bags(
    bags: Sequence[Path], output: Path | None, compression: Compression, screen: Screen
) -> int:
    """`convert`: write sound bags as MCAP."""
    rewrite = partial(convert, compression=compression)
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
    reports = (rewrite(bag, output or _beside(bag, ending)) for bag in bags)
    return _shown(reports, rewrite_page, screen)


def _shown(
    found: Iterable[Result], page_of: Callable[[Result], Page], screen: Screen
) -> list[Result]:
    """All results; each is shown before the next bag is read, which may fail."""
    results, values = [], []
    for each in found:
        results.append(each)
        page = page_of(each)
        values.append(page.values)
        if not screen.as_json:
            screen.show(page)
    if screen.as_json:
        screen.values(values)
    return results


def _beside(bag: Path, ending: str) -> Path:
    whole = bag.resolve()
    name = Path(storage_name(whole)).stem if whole.is_file() else whole.name
    return whole.with_name(f"{name}_{ending}")
