"""Drives of the agents of a table: each expert demonstrates among all other agents."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cached_property
from pathlib import Path

import numpy as np

from serd_app.drives.mapped.actions import PoseTrack, posed_intents
from serd_app.drives.mapped.mapping import TableMapping
from serd_app.drives.recorded_drive import RecordedDrive
from serd_app.drives.unmarked import unmarked_spans, usual_gap_s
from serd_bag.errors import FileError
from serd_bag.formats.rosbag2.layout import is_bag_file
from serd_core.arrays import FloatArray
from serd_files.trajectories.columns import TableColumns
from serd_files.trajectories.read import Track, read_trajectories

#: Velocities of people are central differences over about this time.
_VELOCITY_S = 0.4
#: Of tables in a folder.
_SUFFIXES = frozenset([".csv", ".txt", ".tsv", ".gz", ".parquet", ".pq"])
_LISTED = 5
#: In the name or class of a robot. Where some agents are robots, only these demonstrate.
_ROBOT = re.compile(
    r"(?<![a-z])(?<!non.)(?<!not.)(?<!no.)(robots?[a-z]?|agv|amr|ego)(?![a-z])", re.IGNORECASE
)
#: In the name of a file of people `*` stands for the number in the name of the table.
_NUMBER, _DIGITS = "*", re.compile(r"\d+")


@dataclass(frozen=True, eq=False)
class Crowd:
    """tracks: of all agents; experts: the indices of those that demonstrate, by drive.

    all_robots: whether all agents are robots.
    """

    tracks: tuple[Track, ...]
    experts: tuple[int, ...]
    all_robots: bool = False

    @property
    def people(self) -> tuple[Track, ...]:
        """Agents of the flow: none of robots alone, all where all demonstrate, else the rest."""
        if self.all_robots:
            return ()
        if len(self.experts) == len(self.tracks):
            return self.tracks
        return tuple(each for row, each in enumerate(self.tracks) if row not in self.experts)

    @cached_property
    def position_m(self) -> FloatArray:
        """(N, 2) of the people at all their times."""
        return np.concatenate([track.position_m for track in self.people])

    @cached_property
    def velocity_mps(self) -> FloatArray:
        """(N, 2) of the people at all their times."""
        return np.concatenate([_velocity_mps(track) for track in self.people])


@dataclass(frozen=True, eq=False)
class TableDrives:
    """crowd: None for a single agent; assumed: sentences about what the table does not state."""

    drives: tuple[RecordedDrive, ...]
    crowd: Crowd | None
    assumed: tuple[str, ...]


def is_table(path: Path) -> bool:
    """Whether a path is a file other than a bag's; FileError for a folder of tables."""
    if path.is_dir():
        files = sorted(path.iterdir())
        tables = [each for each in files if each.suffix.lower() in _SUFFIXES]
        if tables and not any(each.name == "metadata.yaml" or is_bag_file(each) for each in files):
            raise FileError(
                f"{path} must be a recording, it is a folder of tables; give these, as"
                f" {path}/*{tables[0].suffix}"
            )
    return path.is_file() and not is_bag_file(path)


def drives_of_table(path: Path, mapping: TableMapping) -> TableDrives:
    """A drive of each expert; FileError where the table cannot be read."""
    found = read_trajectories(path, mapping)
    wanted = mapping.experts or (("*",) if mapping.people else ())
    experts, choice = _experts(path, found.tracks, wanted)
    tracks, assumed = found.tracks, list(found.assumed)
    if mapping.people:
        people, stated = _people_beside(path, found.tracks, mapping)
        tracks, assumed = (*tracks, *people), [*assumed, *stated]
    if choice:
        assumed.append(choice)
    drives = tuple(drive_of_track(tracks[expert], mapping, f"table {path}") for expert in experts)
    crowd = Crowd(tracks, experts, all(map(_is_robot, tracks))) if len(tracks) > 1 else None
    return TableDrives(drives, crowd, tuple(assumed))


def _people_beside(
    path: Path, tracks: Sequence[Track], mapping: TableMapping
) -> tuple[tuple[Track, ...], list[str]]:
    """People of the file beside the table, and what is assumed; FileError where it has none."""
    name, numbers = mapping.people, _DIGITS.findall(path.stem)
    if _NUMBER in name and not numbers:
        raise FileError(
            f"{path} must have a number in its name, which {_NUMBER} stands for in people: {name};"
            " name the file"
        )
    file = path.with_name(name.replace(_NUMBER, numbers[-1] if numbers else ""))
    units = mapping.model_dump(include={"fps", "time_unit", "unit"})
    found = read_trajectories(file, TableColumns(**units))
    people = tuple(track for track in found.tracks if not _is_robot(track))
    if not people:
        raise FileError(f"{file} must hold people, it holds robots alone; correct people:")
    assumed = [f"{file.name}: {sentence}" for sentence in found.assumed]
    if len(people) < len(found.tracks):
        assumed.append(f"{file.name}: its robots are left out, as {path.name} has them")
    (begin_s, end_s), (first_s, last_s) = (
        (min(track.time_s[0] for track in some), max(track.time_s[-1] for track in some))
        for some in (tracks, people)
    )
    if last_s < begin_s or first_s > end_s:
        raise FileError(
            f"{file} must have the clock of {path}, but its times are from {first_s:.10g} to"
            f" {last_s:.10g} s, those of the table from {begin_s:.10g} to {end_s:.10g} s; give"
            " times of one clock"
        )
    return people, assumed


def _is_called(names: Sequence[str], wanted: str) -> bool:
    """Whether it is one of the names, in which * stands for any text."""
    return any(name == wanted or fnmatchcase(name, wanted) for name in names)


def _is_robot(track: Track) -> bool:
    return any(_ROBOT.search(each) for each in (track.name or track.agent, *track.kinds))


def _experts(
    path: Path, tracks: Sequence[Track], wanted: Sequence[str]
) -> tuple[tuple[int, ...], str]:
    """Indices of the agents that demonstrate, and a sentence where that was assumed."""
    names = [track.agent for track in tracks]
    called = [(track.agent, track.name, *track.kinds) for track in tracks]
    missing = [each for each in wanted if not any(_is_called(every, each) for every in called)]
    if missing:
        known = ", ".join(names[:_LISTED]) + (", ..." if len(names) > _LISTED else "")
        raise FileError(
            f"{path}: experts must be agents of the table ({known}), got {missing[0]!r}; correct"
            " the mapping"
        )
    if wanted:
        chosen = (any(_is_called(every, each) for each in wanted) for every in called)
        return tuple(row for row, is_chosen in enumerate(chosen) if is_chosen), ""
    robots = tuple(row for row, track in enumerate(tracks) if _is_robot(track))
    if not robots or len(robots) == len(names):
        choice = f"all {len(names)} agents demonstrate; 'experts:' in a --mapping file names others"
        return tuple(range(len(names))), "" if robots or len(names) == 1 else choice
    named = ", ".join(names[row] for row in robots[:_LISTED])
    more = ", ..." if len(robots) > _LISTED else ""
    verb = "demonstrates" if len(robots) == 1 else "demonstrate"
    return robots, f"{named}{more} {verb} among {len(names) - len(robots)} people ('experts:')"


def drive_of_track(track: Track, mapping: TableMapping, source: str) -> RecordedDrive:
    """The drive of an agent, which demonstrates."""
    longest_gap_s = mapping.longest_gap_s or usual_gap_s(track.time_s)
    spans, cuts = unmarked_spans(track.time_s, track.position_m, longest_gap_s, mapping)
    yaw_rad = np.zeros((len(track.time_s), 1))
    poses = PoseTrack(track.time_s, track.time_s, np.hstack([track.position_m, yaw_rad]))
    intents = posed_intents(mapping, poses, spans)
    return RecordedDrive(
        pose_time_s=track.time_s,
        position_m=track.position_m,
        intent_time_s=intents.time_s,
        intent_action=intents.action,
        episodes=spans,
        source=source,
        intent_hold_s=intents.hold_s,
        longest_gap_s=longest_gap_s,
        minimum_speed_mps=mapping.minimum_speed_mps,
        cuts=cuts,
    )


def _velocity_mps(track: Track) -> FloatArray:
    """(T, 2)."""
    early_s = np.maximum(track.time_s - _VELOCITY_S / 2, track.time_s[0])
    late_s = np.minimum(track.time_s + _VELOCITY_S / 2, track.time_s[-1])
    early_m, late_m = (
        np.stack([np.interp(at_s, track.time_s, axis) for axis in track.position_m.T], 1)
        for at_s in (early_s, late_s)
    )
    return np.asarray((late_m - early_m) / (late_s - early_s)[:, None])
