"""One recording of demonstrations, a bag or a table: its drives, and what could not be read."""

from collections import deque
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from serd_app.drives.episode_spans import EPISODE
from serd_app.drives.mapped.actions import with_hidden_actions
from serd_app.drives.mapped.drive import mapped_drive_in
from serd_app.drives.mapped.mapping import ASSUMED_UNITS, BagMapping, DriveMapping, TableMapping
from serd_app.drives.recorded_drive import INTENT, POSE, RecordedDrive, source_of
from serd_app.drives.recorded_people import crowd_of_sightings, recorded_sightings
from serd_app.drives.sessions import drives_in
from serd_app.drives.table_drives import Crowd, drive_of_track, drives_of_table, is_table
from serd_app.errors import AppError
from serd_bag.damage import Losses
from serd_bag.errors import BagError, DamagedBagError
from serd_bag.reader import BagReader
from serd_bag.topic import topics_named

_OWN_TOPICS = (POSE, INTENT, EPISODE)


@dataclass(frozen=True, eq=False)
class Recording:
    """A drive for each run of the clock, or each agent of a table; damage: sentences about what
    could not be read.

    losses: messages that are missing. crowd: agents who demonstrate among others, assumed: what the
    recording does not state.
    """

    bag: Path
    drives: tuple[RecordedDrive, ...]
    damage: tuple[str, ...]
    losses: Losses
    crowd: Crowd | None = None
    assumed: tuple[str, ...] = ()

    def values(self) -> dict[str, Any]:
        """What of the bag could not be read, as plain values."""
        return {
            "damage": list(self.damage),
            "n_lost": self.losses.n_messages,
            "all_lost_known": self.losses.all_known,
            "assumed": list(self.assumed),
        }


def read_recording(
    bag: Path,
    *,
    mapping: DriveMapping | None,
    tolerant: bool,
    hidden: bool = False,
    goal_area_m: tuple[tuple[float, float], ...] = (),
) -> Recording:
    """A bag of our recorder, or with a mapping any bag, or a table of trajectories.

    tolerant: read what a damaged bag holds. hidden: leave out the actions. goal_area_m: that of the
    scenario, by which a mapping without goals cuts laps.
    """
    of_table = is_table(bag)
    if mapping is None and of_table:
        mapping = TableMapping()
    if mapping is not None and not (mapping.goals_m or mapping.goal_area_m):
        mapping = mapping.model_copy(update={"goal_area_m": goal_area_m})
    if of_table:
        columns = mapping if isinstance(mapping, TableMapping) else TableMapping()
        table = drives_of_table(bag, columns)
        found = Recording(bag, table.drives, (), Losses(), table.crowd, table.assumed)
    else:
        found = _recorded_bag(BagReader(bag, tolerant=tolerant), mapping)
    if not hidden:
        return found
    return replace(found, drives=tuple(map(with_hidden_actions, found.drives)))


def _recorded_bag(reader: BagReader, mapping: DriveMapping | None) -> Recording:
    assumed: tuple[str, ...] = (ASSUMED_UNITS,)
    crowd: Crowd | None = None
    drives: tuple[RecordedDrive, ...]
    if not isinstance(mapping, BagMapping):
        _require_own(reader)
        drives, assumed = drives_in(reader), ()
    elif mapping.experts == "people":
        sightings = recorded_sightings(reader, mapping.people_topic, frame=mapping.frame)
        crowd = crowd_of_sightings(sightings, str(reader.path))
        own, source = TableMapping.of_people(mapping), source_of(reader.path)
        drives = tuple(drive_of_track(track, own, source) for track in crowd.tracks)
    else:
        drives = (_mapped_drive(reader, mapping),)
    damage = tuple(each.sentence() for each in reader.damage)
    lost = reader.losses if damage else Losses()
    return Recording(reader.path, drives, damage, lost, crowd, assumed)


def _mapped_drive(reader: BagReader, mapping: BagMapping) -> RecordedDrive:
    """AppError that names the command which writes a mapping where this one does not fit."""
    try:
        return mapped_drive_in(reader, mapping)
    except DamagedBagError:
        raise
    except BagError as error:
        sentence = f"{error}; 'serd bag suggest {reader.path}' writes a mapping that fits"
        raise AppError(sentence) from None


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
            f" holds no {' and no '.join(lacking)} but {known}; for a bag of another robot,"
            f" 'serd bag suggest {reader.path}' writes a mapping.yaml for --mapping"
        )
