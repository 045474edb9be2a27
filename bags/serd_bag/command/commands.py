"""The commands, and what they print about bags: tables, sentences or JSON.

The exit code is the highest one of all bags.
"""

import json
import shutil
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import zip_longest
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, TextIO

from serd_bag.errors import BagError, printable
from serd_bag.quantities import counted, seconds_in_words

if TYPE_CHECKING:
    from serd_bag.command.rewrite import RewriteReport
    from serd_bag.health.check import BagCheck
    from serd_bag.health.contents import BagContents
    from serd_bag.rescue.certificate import Certificate
    from serd_bag.verbs.cut import Selection

_STANDARD = Path("-")
#: Longer ones are those of another clock, of which digits after the point state nothing.
_LONG_DELAY_S = 100.0
#: Exit codes, of which EXIT_CODES has the meaning.
COMPLETE, INCOMPLETE, BAD_INPUT = range(3)
EXIT_CODES = (
    "exit codes: 0 nothing is missing; 1 a bag is not sound or whole: messages are lost or may be,"
    " check found a fault, or diff a difference; 2 bad arguments, or nothing that can be read"
)


@dataclass(frozen=True)
class Page:
    """What a command prints about one bag: a heading, a table, and lines below it.

    columns: heads of the columns, of one or two lines; texts: indices of those that are aligned
    left, the others hold numbers; remarks: sentences for stderr; values: what is printed as JSON in
    place of all this; code: the exit code.
    """

    heading: str
    columns: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    values: dict[str, Any]
    code: int
    texts: tuple[int, ...] = (0,)
    lines: Sequence[str] = ()
    remarks: Sequence[str] = ()


def run_command(name: str, given: Any) -> int:
    """Run a command of `COMMANDS` with its options and `bags`; returns its exit code.

    `-` as a bag is the standard input, and as output the standard output, on which the new bag is
    written; the result is then shown on stderr.
    """
    with TemporaryDirectory() as folder:
        given.bags = [_standard_input(Path(folder), bag) for bag in given.bags]
        output = getattr(given, "output", None)
        if output != _STANDARD:
            return _shown(_PAGES[name](given), given, sys.stdout)
        if name == "fix-clock":
            raise BagError("--output must be a folder, which has the stamps as they were, got -")
        given.output = Path(folder) / "output"
        code = _shown(_PAGES[name](given), given, sys.stderr)
        for file in sorted(given.output.glob("*.mcap")):
            with file.open("rb") as stream:
                shutil.copyfileobj(stream, sys.stdout.buffer)
    return code


def _standard_input(folder: Path, bag: Path) -> Path:
    """A bag, in place of `-` a file with what comes on the standard input."""
    if bag != _STANDARD:
        return bag
    file = folder / "standard_input.mcap"
    with file.open("wb") as stream:
        shutil.copyfileobj(sys.stdin.buffer, stream)
    return file


def _contents(given: Any) -> Iterator[Page]:
    from serd_bag.health.contents import contents_of_bag

    for bag in given.bags:
        yield _contents_page(contents_of_bag(bag, sizes=given.sizes))


def _checks(given: Any) -> Iterator[Page]:
    from serd_bag.health.check import check_bag

    for bag in given.bags:
        yield _check_page(check_bag(bag, given.require or ()))


def _rescued(given: Any) -> Iterator[Page]:
    from serd_bag.rescue.saving import rescue

    for bag, output in _outputs(given, "rescued"):
        yield _rescue_page(rescue(bag, output, doubtful=not given.verified_only))


def _converted(given: Any) -> Iterator[Page]:
    from serd_bag.command.rewrite import convert

    for bag, output in _outputs(given, "mcap"):
        yield _rewrite_page(convert(bag, output, compression=given.compression))


def _fixed(given: Any) -> Iterator[Page]:
    from serd_bag.verbs.fix_clock import fix_clock

    for bag, output in _outputs(given, "fixed"):
        report = fix_clock(bag, output)
        if report.senders:
            page = _rewrite_page(report)
            of_whom = ", ".join(f"{topic} ({sender})" for topic, sender in report.senders)
            line = f"{counted(report.n_corrected, 'stamp')} corrected, of {of_whom}"
            yield replace(page, lines=[*page.lines, line])
        else:
            heading = f"{bag}: no clock of a sender is wrong, nothing is written"
            yield Page(heading, (), [], _values(report, "n_messages"), COMPLETE)


def _cut(given: Any) -> Iterator[Page]:
    if len(given.bags) > 1:
        raise BagError(f"cut must have one BAG, got {len(given.bags)}; merge takes several")
    yield _selected(given, "cut")


def _merged(given: Any) -> Iterator[Page]:
    yield _selected(given, "merged")


def _selected(given: Any, ending: str) -> Page:
    from serd_bag.verbs.cut import cut

    report = cut(
        given.bags,
        given.output or beside(given.bags[0], ending),
        _selection(given),
        split_bytes=None if given.split_mb is None else round(given.split_mb * 1e6),
        sort=given.sort,
        compression=given.compression,
    )
    return _rewrite_page(report)


def _selection(given: Any) -> "Selection":
    from serd_bag.verbs.cut import Selection

    return Selection(given.topic or (), given.without or (), given.from_s, given.to_s)


def _texts(given: Any) -> Iterator[Page]:
    """Print messages as JSON lines or CSV, without a page."""
    from serd_bag.reader import BagReader
    from serd_bag.verbs.text import csv_lines, json_lines

    reader, selection = BagReader(given.bags[0]), _selection(given)
    columns = given.columns and given.columns.split(",")
    for line in csv_lines(reader, selection, columns) if columns else json_lines(reader, selection):
        print(line)
    yield from ()


def _difference(given: Any) -> Iterator[Page]:
    from serd_bag.verbs.difference import difference

    first, second = given.bags
    topics = [topic for topic in difference(first, second) if not topic.is_same]
    rows = [
        (
            *(topic.name, str(topic.n_same), str(topic.n_only_first), str(topic.n_only_second)),
            "-" if topic.first_s is None else f"{topic.first_s:.3f}",
            ", ".join(topic.others),
        )
        for topic in topics
    ]
    columns = ("topic", "same", "only\nfirst", "only\nsecond", "from\n[s]", "also")
    verdict = f"{counted(len(topics), 'topic')} differ" if topics else "no difference"
    values = {"first": first, "second": second, "topics": [asdict(topic) for topic in topics]}
    code = INCOMPLETE if topics else COMPLETE
    yield Page(f"{first} and {second}: {verdict}", columns, rows, values, code, texts=(0, 5))


def _reindexed(given: Any) -> Iterator[Page]:
    from serd_bag.verbs.reindex import reindex

    for bag in given.bags:
        n_messages = reindex(bag)
        heading = f"{bag}: {counted(n_messages, 'message')}"
        yield Page(heading, (), [], {"path": bag, "n_messages": n_messages}, COMPLETE)


_PAGES: dict[str, Callable[[Any], Iterator[Page]]] = {
    "rescue": _rescued,
    "info": _contents,
    "check": _checks,
    "convert": _converted,
    "fix-clock": _fixed,
    "cut": _cut,
    "merge": _merged,
    "cat": _texts,
    "diff": _difference,
    "reindex": _reindexed,
}


def _outputs(given: Any, ending: str) -> list[tuple[Path, Path]]:
    if given.output is not None and len(given.bags) > 1:
        raise BagError(f"--output must be left out for several bags, got {given.output}; run each")
    return [(bag, given.output or beside(bag, ending)) for bag in given.bags]


def beside(bag: Path, ending: str) -> Path:
    """The folder of a new bag that is made of a bag."""
    from serd_bag.formats.rosbag2.layout import storage_name

    whole = bag.resolve()
    name = Path(storage_name(whole)).stem if whole.is_file() else whole.name
    return whole.with_name(f"{name}_{ending}")


def _shown(pages: Iterable[Page], given: Any, file: TextIO) -> int:
    """Show each page before the next bag is read, which may fail; returns the exit code."""
    values, codes = [], [COMPLETE]
    is_json = getattr(given, "json", False)
    for page in pages:
        values.append(page.values)
        codes.append(page.code)
        if not is_json:
            _show(page, file)
    if is_json:
        text = json.dumps(values, indent=2, ensure_ascii=False, allow_nan=False, default=str)
        print(text, file=file)
    return max(codes)


def _show(page: Page, file: TextIO) -> None:
    """Print the table with a line below its head, then the lines; remarks on stderr."""
    heads = list(zip_longest(*(column.split("\n") for column in page.columns), fillvalue=""))
    rows = [tuple(map(printable, row)) for row in page.rows]
    widths = [max(map(len, column)) for column in zip(*heads, *rows, strict=True)]
    print(page.heading, file=file)
    for line in (*heads, tuple("-" * width for width in widths), *rows):
        cells = (
            text.ljust(width) if column in page.texts else text.rjust(width)
            for column, (text, width) in enumerate(zip(line, widths, strict=True))
        )
        print("  ".join(cells).rstrip(), file=file)
    for sentence in page.lines:
        print(printable(sentence), file=file)
    for remark in page.remarks:
        print(remark, file=sys.stderr)


def _contents_page(found: "BagContents") -> Page:
    """A row per topic: type, messages, rate and, where they are known, bytes."""
    rows: list[tuple[str, ...]] = [
        (topic.name, topic.type_name, str(topic.n_messages), _rate(topic.mean_hz))
        for topic in found.topics
    ]
    columns: tuple[str, ...] = ("topic", "type", "messages", "mean\nHz")
    sizes = [topic.n_bytes for topic in found.topics if topic.n_bytes is not None]
    if sizes:
        columns = (*columns, "bytes")
        rows = [(*row, str(size)) for row, size in zip(rows, sizes, strict=True)]
    is_whole = not found.faults or (found.n_messages and not found.n_lost)
    return Page(
        _heading(found),
        columns,
        rows,
        _values(found, "n_messages"),
        COMPLETE if is_whole else INCOMPLETE,
        texts=(0, 1),
        remarks=found.faults,
    )


def _check_page(found: "BagCheck") -> Page:
    """A row per topic: rates, gaps and the two clocks; then faults, remarks and a verdict."""
    columns = ("topic", "messages", "mean\nHz", "longest\ngap [s]", "gaps", "log time -\nstamp [s]")
    rows = [
        (
            *(topic.name, str(topic.n_messages), _rate(topic.mean_hz)),
            *(f"{topic.longest_gap_s:.2f}", str(topic.n_gaps), _delay(topic.stamp_delay_s)),
        )
        for topic in found.topics
    ]
    lines = [f"fault: {fault}" for fault in found.faults]
    lines += [f"note: {remark}" for remark in found.remarks]
    verdict = "" if found.sound else f" ({counted(len(found.faults), 'fault')})"
    lines.append(f"{'not ' if verdict else ''}sound: {found.path}{verdict}")
    values = _values(found, "sound", "n_messages")
    code = COMPLETE if found.sound else INCOMPLETE
    return Page(_heading(found), columns, rows, values, code, lines=lines)


def _rewrite_page(report: "RewriteReport") -> Page:
    """A row per topic of the new bag; then harmless faults of the old one."""
    return Page(
        f"{report.source} -> {report.target}: {counted(report.n_messages, 'message')}",
        ("topic", "messages"),
        [(name, str(n)) for name, n in sorted(report.counts.items())],
        _values(report, "n_messages"),
        COMPLETE,
        lines=[f"damage: {damage}" for damage in report.damage],
    )


def _rescue_page(found: "Certificate") -> Page:
    """A row per topic with bounds of what was lost; then damage, bytes and the total."""
    from serd_bag.rescue.certificate import lost_in_words, time_in_words

    columns = ("topic", "saved", "doubtful", "lost", "at most\n[s]")
    rows = [
        (
            *(topic.name, str(topic.n_saved), str(topic.n_doubtful)),
            *(lost_in_words(topic), time_in_words(topic)),
        )
        for topic in found.topics
    ]
    lines = [f"damage: {damage}" for damage in found.damage]
    for file in found.files:
        n_bytes = {state: file.n_bytes(state) for state in ("partly read", "lost", "not ours")}
        parts = [f"{count} bytes {state}" for state, count in n_bytes.items() if count]
        if parts:
            lines.append(f"{file.path}: {', '.join(parts)}")
    lines.append(f"messages lost: {lost_in_words(found)}")
    code = COMPLETE if found.is_complete else INCOMPLETE
    is_foreign = any(file.n_bytes("not ours") for file in found.files)
    return Page(
        f"{found.source} -> {found.target}: {counted(found.n_messages, 'message')} saved",
        columns,
        rows,
        found.values(),
        BAD_INPUT if not found.n_messages and (is_foreign or (found.damage and code)) else code,
        lines=lines,
    )


def _heading(found: "BagCheck | BagContents") -> str:
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
