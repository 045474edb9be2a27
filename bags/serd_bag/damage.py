"""What is wrong with the files of a bag, and how many messages are missing."""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from serd_bag.formats.limits import MOST_FAULTS_OF_A_FILE
from serd_bag.formats.rosbag2.layout import BagLayout, storage_name
from serd_bag.topic import RawMessage, Topic

#: Bytes and numbers in the sentence of a fault.
_NUMBERS = re.compile(r"[0-9a-f]{2} [0-9a-f ]+|\d+")


@dataclass(frozen=True)
class Damage:
    """One kind of fault of a file.

    offset: byte of the first such fault, None where it concerns the whole file; count: of them.

    In a summary of several kinds of faults, `what` states so. fix: what may repair it where
    `recover` finds nothing.
    """

    path: Path
    offset: int | None
    what: str
    count: int = 1
    fix: str = ""

    def sentence(self) -> str:
        """File, place, fault, how often it was found, and the fix, in one sentence."""
        where = "" if self.offset is None else f"at byte {self.offset}: "
        often = "" if self.count == 1 else f" (the first of {self.count} such faults)"
        fix = f"; {self.fix}" if self.fix else ""
        return f"{self.path}: {where}{self.what}{often}{fix}"


class DamageLog:
    """The damage of one file: one entry for each kind of fault, with the number of faults."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._found: dict[str, Damage] = {}
        self._counts: Counter[str] = Counter()

    def note(self, offset: int | None, what: str, fix: str = "") -> None:
        """Add a fault; faults that differ in numbers only are of one kind."""
        kind = _NUMBERS.sub("", what)
        if kind not in self._found and len(self._found) >= MOST_FAULTS_OF_A_FILE - 1:
            kind, what, fix = "", "it has further faults of other kinds", ""
        self._found.setdefault(kind, Damage(self._path, offset, what, fix=fix))
        self._counts[kind] += 1

    def __len__(self) -> int:
        return len(self._found)

    @property
    def damage(self) -> list[Damage]:
        """All kinds of faults, in the order in which they were found."""
        return [replace(each, count=self._counts[kind]) for kind, each in self._found.items()]


class FileScan:
    """One pass through one file of a bag; what it found is complete after its messages were read.

    counts: readable messages by topic; expected: number of messages by the end of the file, None
    where it has no count; n_left_out: messages that were found, but are not among those given;
    has_checksums: whether all messages have them; copied: (offset, length) of each sound attachment
    and metadata record.
    """

    has_checksums = False

    def __init__(self, path: Path) -> None:
        self.path = path
        self.counts: Counter[str] = Counter()
        self.expected: int | None = None
        self.n_left_out = 0
        self.copied: list[tuple[int, int]] = []
        self._log = DamageLog(path)

    @property
    def damage(self) -> list[Damage]:
        """Each kind of fault that was found."""
        return self._log.damage

    def topics(self) -> list[Topic]:
        """All topics of the file that can be found."""
        raise NotImplementedError

    def messages(self, topics: frozenset[str] | None = None) -> Iterator[RawMessage]:
        """Messages of the given topics, None for all."""
        raise NotImplementedError

    def _note(self, what: str) -> None:
        """Add a fault that concerns the whole file."""
        self._log.note(None, what)


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
