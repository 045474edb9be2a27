"""The commands, on any screen, and what they print about bags: tables, sentences and plain values.

Each returns its exit code, of several bags the highest.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal, Protocol, TypeVar

from serd_bag.command.rewrite import RewriteReport, convert, recover
from serd_bag.errors import BagError, printable
from serd_bag.formats.mcap.writer import Compression
from serd_bag.formats.rosbag2.layout import storage_name
from serd_bag.health.check import BagCheck, BagContents, TopicCheck, check_bag, contents_of_bag
from serd_bag.quantities import counted, seconds_in_words

Style = Literal["good", "notable", "bad"]

#: Longer ones are those of another clock, of which digits after the point state nothing.
_LONG_DELAY_S = 100.0
#: Exit codes, of which EXIT_CODES has the meaning.
COMPLETE, INCOMPLETE, BAD_INPUT, NOTHING = range(4)
EXIT_CODES = (
    "exit codes: 0 complete, no message is known to be missing; 1 a bag is not sound or whole:"
    " messages are known to be lost or were left out, check found a fault, or info read a damaged"
    " bag without any message; 2 bad arguments or input, as a damaged bag for convert; 3 recover"
    " found no message in a damaged bag"
)
Result = TypeVar("Result")


@dataclass(frozen=True)
class Table:
    """texts: indices of the columns that may be folded; the others hold numbers.

    Names in a bag may hold characters that a terminal obeys; tables and lines have their escapes.
    """

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    texts: tuple[int, ...] = (0,)

    def __post_init__(self) -> None:
        shown = tuple(tuple(map(printable, row)) for row in self.rows)
        object.__setattr__(self, "rows", shown)


@dataclass(frozen=True)
class Line:
    """One sentence below a table."""

    text: str
    style: Style

    def __post_init__(self) -> None:
        object.__setattr__(self, "text", printable(self.text))


@dataclass(frozen=True)
class Page:
    """What is printed about one bag; values: for JSON in its place; remarks: apart from it."""

    heading: str
    table: Table
    values: dict[str, Any]
    lines: Iterable[Line] = ()
    remarks: Sequence[str] = ()


def contents_page(found: BagContents) -> Page:
    """A row per topic: type, messages and rate."""
    rows = (
        (topic.name, topic.type_name, str(topic.n_messages), _rate(topic.mean_hz))
        for topic in found.topics
    )
    table = Table(("topic", "type", "messages", "mean\nHz"), tuple(rows), texts=(0, 1))
    return Page(_heading(found), table, _values(found, "n_messages"), remarks=found.faults)


def check_page(found: BagCheck) -> Page:
    """A row per topic: rates, gaps and the two clocks."""
    columns = (
        *("topic", "messages", "mean\nHz", "usual\nHz"),
        *("longest\ngap [s]", "gaps", "log time -\nstamp [s]"),
    )
    rows = (
        (
            *(topic.name, str(topic.n_messages), _rate(topic.mean_hz), _rate(topic.rate_hz)),
            *(f"{topic.longest_gap_s:.2f}", str(topic.n_gaps), _delay(topic)),
        )
        for topic in found.topics
    )
    values = _values(found, "sound", "n_messages")
    return Page(_heading(found), Table(columns, tuple(rows)), values, _verdict(found))


def rewrite_page(report: RewriteReport) -> Page:
    """A row per topic of the new bag, and per topic left out with the reason."""
    messages = counted(report.n_messages, "message")
    left_out = f", {report.n_left_out} left out" if report.n_left_out else ""
    heading = f"{report.source} -> {report.target}: {messages}{left_out}"
    kept = [(name, str(count)) for name, count in sorted(report.counts.items())]
    table = Table(("topic", "messages"), tuple(kept))
    if report.skipped:
        skipped = [
            (name, f"0 of {report.left_out[name]}", reason)
            for name, reason in sorted(report.skipped.items())
        ]
        rows = (*((*row, "") for row in kept), *skipped)
        table = Table(("topic", "messages", "left out because"), rows, texts=(0, 2))
    return Page(heading, table, _values(report, "n_messages", "n_left_out"), _losses(report))


def _heading(found: BagCheck | BagContents) -> str:
    n_filled = sum(topic.n_messages > 0 for topic in found.topics)
    if not n_filled:
        return f"{found.path}: no message"
    messages, topics = counted(found.n_messages, "message"), counted(n_filled, "topic")
    return f"{found.path}: {messages} on {topics} in {seconds_in_words(found.span_s)}"


def _values(found: Any, *properties: str) -> dict[str, Any]:
    """All fields of the record, and these properties."""
    return {**asdict(found), **{name: getattr(found, name) for name in properties}}


def _verdict(found: BagCheck) -> Iterator[Line]:
    """Faults, remarks and one last line."""
    yield from (Line(f"fault: {fault}", "bad") for fault in found.faults)
    yield from (Line(f"note: {remark}", "notable") for remark in found.remarks)
    if found.sound:
        yield Line(f"sound: {found.path}", "good")
    else:
        yield Line(f"not sound: {found.path} ({counted(len(found.faults), 'fault')})", "bad")


def _losses(report: RewriteReport) -> Iterator[Line]:
    """The damage found, and the messages lost by it."""
    yield from (Line(f"damage: {damage}", "notable") for damage in report.damage)
    if report.n_lost is None:
        yield Line("messages lost: unknown, the damaged bag has no count", "notable")
    elif report.damage:
        at_least = "" if report.all_lost_known else "at least "
        yield Line(f"messages lost: {at_least}{report.n_lost}", "notable")


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


class Screen(Protocol):
    """Where results go; as_json: as values in place of pages."""

    as_json: bool

    def values(self, values: list[dict[str, Any]]) -> None:
        """All results as JSON."""

    def show(self, page: Page) -> None:
        """The result for one bag."""


def show_contents(bags: Sequence[Path], screen: Screen) -> int:
    """`info`: what bags hold."""
    found = _shown(map(contents_of_bag, bags), contents_page, screen)
    is_whole = all(each.n_messages and not each.n_lost for each in found if each.faults)
    return COMPLETE if is_whole else INCOMPLETE


def show_checks(bags: Sequence[Path], required: Sequence[str], screen: Screen) -> int:
    """`check`: read bags completely and list their faults."""
    checks = _shown((check_bag(bag, required) for bag in bags), check_page, screen)
    return COMPLETE if all(each.sound for each in checks) else INCOMPLETE


def recover_bags(bags: Sequence[Path], output: Path | None, screen: Screen) -> int:
    """`recover`: write the readable messages of damaged bags as new bags."""
    return _code(_rewritten(bags, output, "recovered", recover, screen))


def convert_bags(
    bags: Sequence[Path], output: Path | None, compression: Compression, screen: Screen
) -> int:
    """`convert`: write sound bags as MCAP."""
    rewrite = partial(convert, compression=compression)
    return _code(_rewritten(bags, output, "mcap", rewrite, screen))


def _code(reports: Sequence[RewriteReport]) -> int:
    if any(each.damage and not each.n_messages + each.n_left_out for each in reports):
        return NOTHING
    is_whole = not any(each.n_lost or each.n_left_out for each in reports)
    return COMPLETE if is_whole else INCOMPLETE


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
