"""One bag of demonstrations: the drives in it, and what of it could not be read."""

from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bags.damage import Losses
from bags.reader import BagReader
from bags.topic import topics_named
from serd_app.drives.episode_spans import EPISODE
from serd_app.drives.mapped_drive import mapped_drive_in
from serd_app.drives.mapping import BagMapping
from serd_app.drives.recorded_drive import INTENT, POSE, RecordedDrive
from serd_app.drives.sessions import drives_in
from serd_app.errors import AppError

_OWN_TOPICS = (POSE, INTENT, EPISODE)


@dataclass(frozen=True, eq=False)
class Recording:
    """A drive for each run of the clock; damage: sentences about what could not be read.

    losses: messages that are missing.
    """

    bag: Path
    drives: tuple[RecordedDrive, ...]
    damage: tuple[str, ...]
    losses: Losses

    def values(self) -> dict[str, Any]:
        """What of the bag could not be read, as plain values."""
        return {
            "damage": list(self.damage),
            "n_lost": self.losses.n_messages,
            "all_lost_known": self.losses.all_known,
        }


def read_recording(
    bag: Path, period_s: float, *, mapping: BagMapping | None, tolerant: bool
) -> Recording:
    """A bag of our recorder, or with a mapping any bag; tolerant: read what a damaged one holds."""
    reader = BagReader(bag, tolerant=tolerant)
    if mapping is None:
        _require_own(reader)
        drives = drives_in(reader)
    else:
        drives = (mapped_drive_in(reader, mapping, period_s),)
    damage = tuple(each.sentence() for each in reader.damage)
    return Recording(bag, drives, damage, reader.losses if damage else Losses())


def _require_own(reader: BagReader) -> None:
    """AppError unless the bag holds the topics that our recorder writes."""
    if not reader.topics:
        deque(reader.messages(), maxlen=0)  # damage is found while messages are read
    if reader.damage and not reader.topics:
        raise AppError(f"nothing in bag {reader.path} is readable: {reader.damage[0].sentence()}")
    known = ", ".join(sorted(reader.topics)) or "nothing"
    lacking = [name for name in _OWN_TOPICS if not topics_named(reader.topics, name)]
    if lacking:
        raise AppError(
            f"bag {reader.path} must hold {', '.join(_OWN_TOPICS)} as our recorder writes them, it"
            f" holds no {' and no '.join(lacking)} but {known}; name the topics in a --mapping file"
        )
