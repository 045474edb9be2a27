"""What is wrong with the files of a bag, and how many messages are missing."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from bags.rosbag2.layout import BagLayout, storage_name


@dataclass(frozen=True)
class Damage:
    """offset: byte at which the reader found it, None where it concerns the whole file."""

    path: Path
    offset: int | None
    what: str

    def sentence(self) -> str:
        """File, place and fault in one sentence."""
        where = "" if self.offset is None else f"at byte {self.offset}: "
        return f"{self.path}: {where}{self.what}"


@dataclass(frozen=True)
class Losses:
    """n_messages: known to be lost; all_known: whether no more than those can be lost."""

    n_messages: int = 0
    all_known: bool = True


@dataclass(frozen=True)
class FileCount:
    """found: messages read; expected: by the end of the file, None where it has no count."""

    path: Path
    found: int
    expected: int | None


def losses(layout: BagLayout, files: Sequence[FileCount]) -> Losses:
    """Messages missing from the files that were read and from those that metadata.yaml lists."""
    listed = layout.messages_by_file
    missing = set(listed) - {storage_name(file.path) for file in files}
    lost = sum(listed[name] for name in missing)
    unknown = layout.metadata is None and layout.path.is_dir()
    for file in files:
        expected = listed.get(storage_name(file.path)) if file.expected is None else file.expected
        unknown |= expected is None
        lost += max(0, (expected or 0) - file.found)
    total = layout.n_messages
    if unknown and total is not None and not missing:
        return Losses(max(0, total - sum(file.found for file in files)))
    return Losses(lost, not unknown)
