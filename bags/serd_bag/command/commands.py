"""The commands, on any screen, and what they print about bags: tables, sentences and plain values.

Each returns its exit code, of several bags the highest.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal, Protocol

from serd_bag.command.rewrite import RewriteReport, convert, recover
from serd_bag.errors import BagError
from serd_bag.formats.mcap.writer import Compression
from serd_bag.formats.rosbag2.layout import storage_name
from serd_bag.health.check import BagCheck, BagContents, check_bag, contents_of_bag
from serd_bag.quantities import counted, seconds_in_words

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
#: A sentence below a table and how it is to be shown.
Line = tuple[Literal["good", "notable", "bad"], str]


@dataclass(frozen=True)
class Page:
    """What a command prints about one bag: a heading, a table, and lines below it.

    columns: heads of the columns, of one or two lines; texts: indices of the columns that may be
    folded, the others hold numbers; remarks: sentences for stderr; values: what is printed as JSON
    in place of all this; code: the exit code. Names in a bag may hold characters that a terminal
    obeys: `serd_bag.errors.printable` must be applied to rows and lines.
    """

    heading: str
    columns: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    values: dict[str, Any]
    code: int
    texts: tuple[int, ...] = (0,)
    lines: Sequence[Line] = ()
    remarks: Sequence[str] = ()


class Screen(Protocol):
    """Where results go; as_json: as values in place of pages."""

    as_json: bool

    def values(self, values: list[dict[str, Any]]) -> None:
        """All results as JSON."""

    def show(self, page: Page) -> None:
        """The result for one bag."""


def show_contents(bags: Sequence[Path], screen: Screen) -> int:
    """`info`: show what bags hold."""
    return _shown((_contents_page(contents_of_bag(bag)) for bag in bags), screen)


def show_checks(bags: Sequence[Path], required: Sequence[str], screen: Screen) -> int:
    """`check`: read bags completely and list their faults."""
    return _shown((_check_page(check_bag(bag, required)) for bag in bags), screen)


def recover_bags(bags: Sequence[Path], output: Path | None, screen: Screen) -> int:
    """`recover`: write the readable messages of damaged bags as new bags."""
    return _rewritten(bags, output, "recovered", recover, screen)


def convert_bags(
    bags: Sequence[Path], output: Path | None, compression: Compression, screen: Screen
) -> int:
    """`convert`: write sound bags as MCAP."""
    return _rewritten(bags, output, "mcap", partial(convert, compression=compression), screen)


def _rewritten(
    bags: Sequence[Path],
    output: Path | None,
    ending: str,
    rewrite: Callable[[Path, Path], RewriteReport],
    screen: Screen,
) -> int:
    if output is not None and len(bags) > 1:
        raise BagError(f"--output must be left out for several bags, got {output}; run each")
    reports = (rewrite(bag, output or _beside(bag, ending)) for bag in bags)
    return _shown(map(_rewrite_page, reports), screen)


def _beside(bag: Path, ending: str) -> Path:
    whole = bag.resolve()
    name = Path(storage_name(whole)).stem if whole.is_file() else whole.name
    return whole.with_name(f"{name}_{ending}")


def _shown(pages: Iterable[Page], screen: Screen) -> int:
    """Show each page before the next bag is read, which may fail; returns the exit code."""
    values, codes = [], [COMPLETE]
    for page in pages:
        values.append(page.values)
        codes.append(page.code)
        if not screen.as_json:
            screen.show(page)
    if screen.as_json:
        screen.values(values)
    return max(codes)


def _contents_page(found: BagContents) -> Page:
    """A row per topic: type, messages and rate."""
    rows = [
        (topic.name, topic.type_name, str(topic.n_messages), _rate(topic.mean_hz))
        for topic in found.topics
    ]
    is_whole = not found.faults or (found.n_messages and not found.n_lost)
    return Page(
        _heading(found),
        ("topic", "type", "messages", "mean\nHz"),
        rows,
        _values(found, "n_messages"),
        COMPLETE if is_whole else INCOMPLETE,
        texts=(0, 1),
        remarks=found.faults,
    )


def _check_page(found: BagCheck) -> Page:
    """A row per topic: rates, gaps and the two clocks; then faults, remarks and a verdict."""
    columns = (
        *("topic", "messages", "mean\nHz", "usual\nHz"),
        *("longest\ngap [s]", "gaps", "log time -\nstamp [s]"),
    )
    rows = [
        (
            *(topic.name, str(topic.n_messages), _rate(topic.mean_hz), _rate(topic.rate_hz)),
            *(f"{topic.longest_gap_s:.2f}", str(topic.n_gaps), _delay(topic.stamp_delay_s)),
        )
        for topic in found.topics
    ]
    lines: list[Line] = [("bad", f"fault: {fault}") for fault in found.faults]
    lines += [("notable", f"note: {remark}") for remark in found.remarks]
    if found.sound:
        lines.append(("good", f"sound: {found.path}"))
    else:
        lines.append(("bad", f"not sound: {found.path} ({counted(len(found.faults), 'fault')})"))
    values = _values(found, "sound", "n_messages")
    code = COMPLETE if found.sound else INCOMPLETE
    return Page(_heading(found), columns, rows, values, code, lines=lines)


def _rewrite_page(report: RewriteReport) -> Page:
    """A row per topic of the new bag, and per topic left out with the reason; then the losses."""
    left_out = f", {report.n_left_out} left out" if report.n_left_out else ""
    messages = counted(report.n_messages, "message")
    columns: tuple[str, ...] = ("topic", "messages")
    rows: list[tuple[str, ...]] = [(name, str(n)) for name, n in sorted(report.counts.items())]
    if report.skipped:
        columns = (*columns, "left out because")
        rows = [(*row, "") for row in rows]
        rows += [
            (name, f"0 of {report.left_out[name]}", reason)
            for name, reason in sorted(report.skipped.items())
        ]
    lines: list[Line] = [("notable", f"damage: {damage}") for damage in report.damage]
    if report.n_lost is None:
        lines.append(("notable", "messages lost: unknown, the damaged bag has no count"))
    elif report.damage:
        at_least = "" if report.all_lost_known else "at least "
        lines.append(("notable", f"messages lost: {at_least}{report.n_lost}"))
    code = INCOMPLETE if report.n_lost or report.n_left_out else COMPLETE
    return Page(
        f"{report.source} -> {report.target}: {messages}{left_out}",
        columns,
        rows,
        _values(report, "n_messages", "n_left_out"),
        code if report.n_messages + report.n_left_out or not report.damage else NOTHING,
        texts=(0, 2),
        lines=lines,
    )


def _heading(found: BagCheck | BagContents) -> str:
    n_filled = sum(topic.n_messages > 0 for topic in found.topics)
    if not n_filled:
        return f"{found.path}: no message"
    messages, topics = counted(found.n_messages, "message"), counted(n_filled, "topic")
    return f"{found.path}: {messages} on {topics} in {seconds_in_words(found.span_s)}"


def _values(found: Any, *properties: str) -> dict[str, Any]:
    """All fields of the record, and these properties."""
    return {**asdict(found), **{name: getattr(found, name) for name in properties}}


def _rate(hz: float | None) -> str:
    """At least three digits: map and marks are sent less than once a second."""
    if hz is None:
        return "-"
    return f"{hz:.1f}" if hz >= 1 else f"{hz:.3f}"


def _delay(delay_s: tuple[float, float] | None) -> str:
    if delay_s is None:
        return "no stamps"
    return "…".join(f"{s:.3f}" if abs(s) < _LONG_DELAY_S else f"{s:.3g}" for s in delay_s)
