"""How many messages a bag has lost, by what metadata.yaml and the ends of its files tell."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from bags.rosbag2.layout import BagLayout, storage_name


@dataclass(frozen=True)
class Losses:
    """n_messages: known to be lost; all_known: whether that is all there can be."""

    n_messages: int = 0
    all_known: bool = True


@dataclass(frozen=True)
class FileCount:
    """found: messages read; told: what the end of the file says, None where it says nothing."""

    path: Path
    found: int
    told: int | None


def losses(layout: BagLayout, files: Sequence[FileCount]) -> Losses:
    """What is missing of the files that were read and of those that should be there too."""
    told_of = layout.messages_by_file
    missing = set(told_of) - {storage_name(file.path) for file in files}
    lost = sum(told_of[name] for name in missing)
    unknown = layout.told is None and layout.path.is_dir()
    for file in files:
        told = told_of.get(storage_name(file.path)) if file.told is None else file.told
        unknown |= told is None
        lost += max(0, (told or 0) - file.found)
    whole = layout.n_messages
    if unknown and whole is not None and not missing:
        return Losses(max(0, whole - sum(file.found for file in files)))
    return Losses(lost, not unknown)
