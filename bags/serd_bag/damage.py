"""What is wrong with the files of a bag, and how many messages are missing."""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, NamedTuple

from serd_bag.errors import BagError, disk_errors
from serd_bag.formats.limits import MOST_FAULTS_OF_A_FILE
from serd_bag.formats.mcap.window import FileWindow
from serd_bag.formats.rosbag2.layout import BagLayout, storage_name
from serd_bag.topic import Channel, Record

State = Literal["read", "partly read", "lost", "not ours"]
_MOST_SPANS = 10_000

#: Bytes and numbers in the sentence of a fault.
_NUMBERS = re.compile(r"[0-9a-f]{2} [0-9a-f ]+|\d+")


@dataclass(frozen=True)
class Damage:
    """One kind of fault of a file.

    offset: byte of the first such fault, None where it concerns the whole file; count: of them.

    In a summary of several kinds of faults, `what` states so. fix: what may repair it where
    `rescue` finds nothing. is_harmless: whether no message depends on it.
    """

    path: Path
    offset: int | None
    what: str
    count: int = 1
    fix: str = ""
    is_harmless: bool = False

    def sentence(self) -> str:
        """File, place, fault, how often it was found, and the fix, in one sentence."""
        where = "" if self.offset is None else f"at byte {self.offset}: "
        often = "" if self.count == 1 else f" (the first of {self.count} such faults)"
        fix = f"; {self.fix}" if self.fix else ""
        return f"{self.path}: {where}{self.what}{often}{fix}"


class DamageLog:
    """The damage of one file: one entry for each kind of fault, with the number of faults."""

    def __init__(self, path: Path, start: int = 0) -> None:
        self._path, self._start = path, start
        self._found: dict[str, Damage] = {}
        self._counts: Counter[str] = Counter()

    def note(
        self, offset: int | None, what: str, fix: str = "", *, is_harmless: bool = False
    ) -> None:
        """Add a fault; faults that differ in numbers only are of one kind."""
        kind = _NUMBERS.sub("", what)
        if kind not in self._found and len(self._found) >= MOST_FAULTS_OF_A_FILE - 1:
            kind, what, fix, is_harmless = "", "it has further faults of other kinds", "", False
        place = None if offset is None else self._start + offset
        fault = Damage(self._path, place, what, fix=fix, is_harmless=is_harmless)
        self._found.setdefault(kind, fault)
        self._counts[kind] += 1

    def __len__(self) -> int:
        return len(self._found)

    @property
    def damage(self) -> list[Damage]:
        """All kinds of faults, in the order in which they were found."""
        return [replace(each, count=self._counts[kind]) for kind, each in self._found.items()]


@dataclass(frozen=True)
class Span:
    """Bytes of a file from `start` to `end`, what became of them, and why."""

    start: int
    end: int
    state: State
    reason: str = ""


class Stated(NamedTuple):
    """What a file states of its contents: types and numbers of messages by topic, and their first
    and last log time (ns), 0 without messages."""

    types: dict[str, str]
    counts: Counter[str]
    first_ns: int
    last_ns: int


class FileScan:
    """One walk through a file of a bag, or through its part from `start` to `end`.

    What it found is complete once its records were read. counts: sound messages by topic;
    n_doubtful: those of damaged parts; n_left_out: messages that were found, but are not given.
    expected, expected_of: number of messages by the end of the file, of all and by topic, None
    where it has no count; is_cut: whether its end is missing. has_checksums: whether all messages
    have them; copied: (offset, length) of each sound attachment and metadata record; is_doubtful:
    whether the record that was given last is of a damaged part. log: faults; marks: bytes of the
    part that were not read, or not all of them.
    """

    has_checksums = False
    is_cut = False
    profile = "ros2"

    def __init__(self, path: Path, start: int = 0, end: int | None = None) -> None:
        self.path, self.start, self.end = path, start, end
        self.counts: Counter[str] = Counter()
        self.n_doubtful: Counter[str] = Counter()
        self.expected: int | None = None
        self.expected_of: dict[str, int] = {}
        self.n_left_out = 0
        self.copied: list[tuple[int, int]] = []
        self.is_doubtful = False
        self.log = DamageLog(path, start)
        self.marks: list[Span] = []

    @property
    def spans(self) -> list[Span]:
        """All bytes of the part, in order, by their places in the file."""
        size = self.path.stat().st_size if self.end is None else self.end
        spans, place = [], self.start
        for span in sorted(self.marks, key=lambda each: each.start):
            start, end = max(place, span.start + self.start), min(size, span.end + self.start)
            if end > start:
                spans += [Span(place, start, "read")] if start > place else []
                spans.append(Span(start, end, span.state, span.reason))
                place = end
        return [*spans, Span(place, size, "read")] if place < size else spans

    def metadata(self) -> list[tuple[str, dict[str, str]]]:
        """Names and values of metadata records, as MCAP files have them."""
        return []

    def stated(self) -> Stated | None:
        """What the file states of its contents; None where that does not prove itself."""
        return None

    def channels(self) -> list[Channel]:
        """All channels of the file that can be found."""
        raise NotImplementedError

    def records(
        self, topics: frozenset[str] | None = None, *, doubtful: bool = False
    ) -> Iterator[Record]:
        """Messages of the given topics, None for all; doubtful ones too where that is asked for."""
        raise NotImplementedError

    @contextmanager
    def opened(self) -> Iterator[FileWindow]:
        """The bytes of the part."""
        with disk_errors("read", self.path, BagError), self.path.open("rb", buffering=0) as stream:
            yield FileWindow(stream, self.start, self.end)

    def mark(self, start: int, end: int, state: State, reason: str) -> None:
        """Note that these bytes of the part were not read, or not all of them."""
        if len(self.marks) < _MOST_SPANS:
            self.marks.append(Span(start, end, state, reason))


@dataclass(frozen=True)
class Losses:
    """Messages of a bag that are missing.

    n_messages: known to be lost; all_known: whether no more than those can be lost.
    """

    n_messages: int = 0
    all_known: bool = True


def losses(layout: BagLayout, files: Sequence[tuple[Path, FileScan]]) -> Losses:
    """Messages missing from the files that were read and from those that metadata.yaml lists."""
    listed = layout.messages_by_file
    missing = set(listed) - {storage_name(path) for path, _ in files}
    lost = sum(listed[name] for name in missing)
    unknown = layout.metadata is None and layout.path.is_dir()
    for path, file in files:
        expected = listed.get(storage_name(path)) if file.expected is None else file.expected
        unknown |= expected is None
        lost += max(file.n_left_out, (expected or 0) - file.counts.total())
    total = layout.n_messages
    if unknown and total is not None and not missing:
        n_left_out = sum(file.n_left_out for _, file in files)
        return Losses(max(n_left_out, total - sum(file.counts.total() for _, file in files)))
    return Losses(lost, not unknown)


def missing_messages(layout: BagLayout, found: Counter[str]) -> list[str]:
    """How sound files differ from what metadata.yaml lists: they may not hold what was recorded."""
    listed = layout.messages_by_topic
    wrong = [
        f"metadata.yaml lists {listed.get(name, 0)} messages on {name},"
        f" the files hold {found[name]}"
        for name in sorted({*listed, *found})
        if listed and listed.get(name, 0) != found[name]
    ]
    total = layout.n_messages
    if not wrong and total is not None and total != found.total():
        wrong = [f"metadata.yaml lists {total} messages, the files hold {found.total()}"]
    return wrong
