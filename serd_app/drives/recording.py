"""One recording of demonstrations: a bag, or a table of agents each of which demonstrates among the
others; its drives, and what could not be read."""

import re
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np

from serd_app.drives.actions import PoseTrack, posed_intents
from serd_app.drives.drive import EPISODE, INTENT, POSE, RecordedDrive
from serd_app.drives.mapped import mapped_drive_in
from serd_app.drives.mapping import (
    ASSUMED_UNITS,
    BagMapping,
    DriveMapping,
    TableMapping,
    unmarked_spans,
    usual_gap_s,
)
from serd_app.drives.sessions import drives_in
from serd_app.errors import AppError, MappingError
from serd_bag.damage import Losses
from serd_bag.errors import BagError, DamagedBagError, FileError
from serd_bag.formats.rosbag2.layout import is_bag_file
from serd_bag.reader import BagReader
from serd_bag.topic import topics_named
from serd_files.trajectories.databases import is_wildtrack
from serd_files.trajectories.read import Track, read_trajectories
from serd_files.yaml_config import load_yaml_model

_OWN_TOPICS = (POSE, INTENT, EPISODE)
#: Of tables in a folder.
_SUFFIXES = frozenset([".csv", ".txt", ".tsv"])
_LISTED = 5
#: In the name or class of a robot. Where some agents are robots, only these demonstrate.
_ROBOT = re.compile(
    r"(?<![a-z])(?<!non.)(?<!not.)(?<!no.)(robots?[a-z]?|agv|amr|ego)(?![a-z])", re.IGNORECASE
)


@dataclass(frozen=True, eq=False)
class Recording:
    """A drive for each run of the clock, or each expert of a table; damage: sentences about what
    could not be read.

    losses: messages that are missing. of_table: whether it is a table. people: agents of its flow,
    none of robots alone, all where all demonstrate, else the rest. assumed: what the recording does
    not state.
    """

    bag: Path
    drives: tuple[RecordedDrive, ...]
    damage: tuple[str, ...] = ()
    losses: Losses = field(default_factory=Losses)
    of_table: bool = False
    people: tuple[Track, ...] = ()
    assumed: tuple[str, ...] = ()


def is_table(path: Path) -> bool:
    """Whether a path is a file other than a bag's; FileError for a folder of tables."""
    if path.is_dir():
        if is_wildtrack(path):
            return True
        files = sorted(path.iterdir())
        tables = [each for each in files if each.suffix.lower() in _SUFFIXES]
        if tables and not any(each.name == "metadata.yaml" or is_bag_file(each) for each in files):
            raise FileError(
                f"{path} must be a recording, it is a folder of tables; give these, as"
                f" {path}/*{tables[0].suffix}"
            )
    return path.is_file() and not is_bag_file(path)


def read_mapping(file: Path | None, paths: Sequence[Path]) -> DriveMapping | None:
    """The mapping of a file, for bags or for tables; None without a file or without paths."""
    if file is None or not paths:
        return None
    kinds = {TableMapping if is_table(each) else BagMapping for each in paths}
    if len(kinds) > 1:
        raise AppError(f"--mapping must be for bags or for tables, got {file} for both")
    return load_yaml_model(file, kinds.pop())


def read_recording(
    path: Path,
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
    of_table = is_table(path)
    if mapping is None and of_table:
        mapping = TableMapping()
    if mapping is not None:
        mapping = mapping.with_goal(goal_area_m)
    if of_table:
        found = _table(path, mapping if isinstance(mapping, TableMapping) else TableMapping())
    else:
        found = _bag(BagReader(path, tolerant=tolerant), mapping)
    if not hidden:
        return found
    return replace(found, drives=tuple(drive.with_hidden_actions for drive in found.drives))


def _bag(reader: BagReader, mapping: DriveMapping | None) -> Recording:
    drives: tuple[RecordedDrive, ...]
    if isinstance(mapping, BagMapping):
        drives = (_mapped_drive(reader, mapping),)
    else:
        drives = _own_drives(reader)
    damage = tuple(each.sentence() for each in reader.damage)
    lost = reader.losses if damage else Losses()
    assumed = (ASSUMED_UNITS,) if isinstance(mapping, BagMapping) else ()
    return Recording(reader.path, drives, damage, lost, assumed=assumed)


def _mapped_drive(reader: BagReader, mapping: BagMapping) -> RecordedDrive:
    """MappingError that names the command which writes one where this one does not fit."""
    try:
        return mapped_drive_in(reader, mapping)
    except DamagedBagError:
        raise
    except BagError as error:
        remedy = f"'serd bag suggest {reader.path}' writes a mapping that fits"
        raise MappingError(str(error), remedy) from None


def _own_drives(reader: BagReader) -> tuple[RecordedDrive, ...]:
    """MappingError unless the bag holds the topics that our recorder writes."""
    if not reader.topics:
        deque(reader.messages(), maxlen=0)  # damage is found while messages are read
    if reader.damage and not reader.topics:
        raise AppError(f"nothing in bag {reader.path} is readable: {reader.damage[0].sentence()}")
    known = ", ".join(sorted(reader.topics)) or "nothing"
    lacking = [name for name in _OWN_TOPICS if not topics_named(reader.topics, name)]
    if lacking:
        raise MappingError(
            f"bag {reader.path} must hold {', '.join(_OWN_TOPICS)} as our recorder writes them, it"
            f" holds no {' and no '.join(lacking)} but {known}",
            f"for a bag of another robot, 'serd bag suggest {reader.path}' writes a mapping.yaml"
            " for --mapping",
        )
    return drives_in(reader)


def _table(path: Path, mapping: TableMapping) -> Recording:
    """A drive of each expert; FileError where the table cannot be read."""
    found = read_trajectories(path, mapping)
    tracks = found.tracks
    experts, choice = _experts(path, tracks, mapping.experts)
    drives = tuple(_drive_of_track(tracks[expert], mapping, f"table {path}") for expert in experts)
    others = tuple(track for row, track in enumerate(tracks) if row not in experts)
    no_people = len(tracks) == 1 or all(map(_is_robot, tracks))
    people = () if no_people else others or tracks
    assumed = (*found.assumed, choice) if choice else found.assumed
    return Recording(path, drives, of_table=True, people=people, assumed=assumed)


def _experts(
    path: Path, tracks: Sequence[Track], wanted: Sequence[str]
) -> tuple[tuple[int, ...], str]:
    """Indices of the agents that demonstrate, and a sentence where that was assumed."""
    names = [track.agent for track in tracks]
    rows_of = {
        each: [
            row
            for row, track in enumerate(tracks)
            for names in [(track.agent, track.name, *track.kinds)]
            if each in names or any(fnmatchcase(name, each) for name in names)
        ]
        for each in wanted
    }
    missing = [each for each, rows in rows_of.items() if not rows]
    if missing:
        known = ", ".join(names[:_LISTED]) + (", ..." if len(names) > _LISTED else "")
        raise FileError(
            f"{path}: experts must be agents of the table ({known}), got {missing[0]!r}; correct"
            " the mapping"
        )
    if wanted:
        return tuple(sorted({row for rows in rows_of.values() for row in rows})), ""
    robots = tuple(row for row, track in enumerate(tracks) if _is_robot(track))
    if not robots or len(robots) == len(names):
        choice = f"all {len(names)} agents demonstrate; 'experts:' in a --mapping file names others"
        return tuple(range(len(names))), "" if robots or len(names) == 1 else choice
    named = ", ".join(names[row] for row in robots[:_LISTED])
    more = ", ..." if len(robots) > _LISTED else ""
    verb = "demonstrates" if len(robots) == 1 else "demonstrate"
    return robots, f"{named}{more} {verb} among {len(names) - len(robots)} people ('experts:')"


def _is_robot(track: Track) -> bool:
    return any(_ROBOT.search(each) for each in (track.name or track.agent, *track.kinds))


def _drive_of_track(track: Track, mapping: TableMapping, source: str) -> RecordedDrive:
    """The drive of an agent, which demonstrates."""
    longest_gap_s = mapping.longest_gap_s or usual_gap_s(track.time_s)
    spans, cuts = unmarked_spans(track.time_s, track.position_m, longest_gap_s, mapping)
    yaw_rad = np.zeros((len(track.time_s), 1))
    poses = PoseTrack(track.time_s, track.time_s, np.hstack([track.position_m, yaw_rad]))
    return RecordedDrive(
        pose_time_s=track.time_s,
        position_m=track.position_m,
        episodes=spans,
        source=source,
        longest_gap_s=longest_gap_s,
        minimum_speed_mps=mapping.minimum_speed_mps,
        cuts=cuts,
        **posed_intents(mapping, poses, spans),
    )
