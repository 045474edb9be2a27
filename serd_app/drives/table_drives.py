"""Drives of agents: each expert is a demonstration, and all agents are the people that others walk
among."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from bags.rosbag2.layout import is_bag_file
from serd_app.drives.mapped_actions import PoseTrack, posed_intents
from serd_app.drives.mapping import TableMapping
from serd_app.drives.recorded_drive import RecordedDrive
from serd_app.drives.unmarked import unmarked_spans, usual_gap_s
from serd_core.arrays import FloatArray
from storage.errors import FileError
from storage.trajectories.read import Track, read_trajectories

#: Velocities of people are central differences over about this time.
_VELOCITY_S = 0.4
#: Steps between places of an agent across which its place is interpolated for others.
_LONGEST_STEP_S = 1.0
_TOLERANCE_S = 1e-6
_LISTED = 5
#: Name of the agent that alone demonstrates where the others have other names.
_ROBOT = re.compile(r"robots?([ _-]?\d+)?$", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class Crowd:
    """The tracks of all agents, and the places in them of those that demonstrate, by drive."""

    tracks: tuple[Track, ...]
    experts: tuple[int, ...]

    @property
    def people(self) -> tuple[Track, ...]:
        """Those whose flow counts: all where all demonstrate, else the others."""
        if len(self.experts) == len(self.tracks):
            return self.tracks
        return tuple(each for row, each in enumerate(self.tracks) if row not in self.experts)

    @cached_property
    def position_m(self) -> FloatArray:
        """(N, 2) of the people at all times."""
        return np.concatenate([track.position_m for track in self.people])

    @cached_property
    def velocity_mps(self) -> FloatArray:
        """(N, 2) likewise."""
        return np.concatenate([_velocity_mps(track) for track in self.people])

    def others_at(self, drive: int, time_s: FloatArray) -> list[FloatArray]:
        """(n, 2) places of all agents but that of a drive, at each of the times (T,)."""
        found = [list[FloatArray]() for _ in time_s]
        for row, track in enumerate(self.tracks):
            if row == self.experts[drive]:
                continue
            after = np.searchsorted(track.time_s, time_s - _TOLERANCE_S)
            last = len(track.time_s) - 1
            step_s = track.time_s[np.minimum(after, last)] - track.time_s[np.maximum(after - 1, 0)]
            within = (time_s >= track.time_s[0] - _TOLERANCE_S) & (after <= last)
            for place in np.flatnonzero(within & (step_s <= _LONGEST_STEP_S)).tolist():
                at = [np.interp(time_s[place], track.time_s, each) for each in track.position_m.T]
                found[place].append(np.array(at))
        return [np.array(each).reshape(-1, 2) for each in found]


@dataclass(frozen=True, eq=False)
class TableDrives:
    """crowd: None for a single agent; assumed: sentences about what the table does not state."""

    drives: tuple[RecordedDrive, ...]
    crowd: Crowd | None
    assumed: tuple[str, ...]


def is_table(path: Path) -> bool:
    """Whether it is a file that is no storage file of a bag."""
    return path.is_file() and not is_bag_file(path)


def drives_of_table(path: Path, mapping: TableMapping, period_s: float) -> TableDrives:
    """A drive of each expert; FileError where the table cannot be read."""
    found = read_trajectories(path, mapping)
    assumed = found.assumed
    experts, choice = _experts(path, found.tracks, mapping.experts)
    if choice:
        assumed = (*assumed, choice)
    drives = drives_of_tracks(found.tracks, experts, mapping, period_s, f"table {path}")
    crowd = Crowd(found.tracks, experts) if len(found.tracks) > 1 else None
    return TableDrives(drives, crowd, assumed)


def drives_of_tracks(
    tracks: Sequence[Track],
    experts: Sequence[int],
    mapping: TableMapping,
    period_s: float,
    source: str,
) -> tuple[RecordedDrive, ...]:
    """The drives of the experts among agents."""
    return tuple(_drive(tracks[expert], mapping, period_s, source) for expert in experts)


def _experts(
    path: Path, tracks: Sequence[Track], wanted: Sequence[str]
) -> tuple[tuple[int, ...], str]:
    """Places of the agents that demonstrate, and a sentence where that was assumed."""
    names = [track.agent for track in tracks]
    missing = [name for name in wanted if name not in names]
    if missing:
        known = ", ".join(names[:_LISTED]) + (", ..." if len(names) > _LISTED else "")
        raise FileError(
            f"{path}: experts must be agents of the table ({known}), got {missing[0]!r}; correct"
            " the mapping"
        )
    if wanted:
        return tuple(row for row, name in enumerate(names) if name in wanted), ""
    robots = tuple(
        row
        for row, name in enumerate(names)
        if _ROBOT.match(name) or _ROBOT.match(tracks[row].kind)
    )
    if not robots or len(robots) == len(names):
        return tuple(range(len(names))), ""
    named = ", ".join(names[row] for row in robots[:_LISTED])
    return robots, f"{named} demonstrates among {len(names) - len(robots)} people ('experts:')"


def _drive(track: Track, mapping: TableMapping, period_s: float, source: str) -> RecordedDrive:
    longest_gap_s = mapping.longest_gap_s or usual_gap_s(track.time_s)
    spans, cuts = unmarked_spans(track.time_s, track.position_m, longest_gap_s, mapping)
    yaw_rad = np.zeros((len(track.time_s), 1))
    poses = PoseTrack(track.time_s, track.time_s, np.hstack([track.position_m, yaw_rad]))
    intents = posed_intents(mapping, poses, spans, period_s)
    return RecordedDrive(
        pose_time_s=track.time_s,
        position_m=track.position_m,
        intent_time_s=intents.time_s,
        intent_action=intents.action,
        episodes=spans,
        source=source,
        longest_gap_s=longest_gap_s,
        minimum_speed_mps=mapping.minimum_speed_mps,
        cuts=cuts,
    )


def _velocity_mps(track: Track) -> FloatArray:
    """(T, 2)."""
    early_s = np.maximum(track.time_s - _VELOCITY_S / 2, track.time_s[0])
    late_s = np.minimum(track.time_s + _VELOCITY_S / 2, track.time_s[-1])
    moved = [
        np.interp(late_s, track.time_s, each) - np.interp(early_s, track.time_s, each)
        for each in track.position_m.T
    ]
    return np.asarray(np.stack(moved, axis=1) / (late_s - early_s)[:, None])
