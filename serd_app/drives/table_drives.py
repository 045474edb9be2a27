"""Drives of the agents of a trajectory table: each is a demonstration, and one of the people that
the others walk among."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from serd_app.drives.mapped_actions import PoseTrack, posed_intents
from serd_app.drives.mapping import TableMapping
from serd_app.drives.recorded_drive import RecordedDrive
from serd_app.drives.unmarked import unmarked_spans, usual_gap_s
from serd_core.arrays import FloatArray
from storage.trajectories.read import Track, read_trajectories

#: Velocities of people are central differences over about this time.
_VELOCITY_S = 0.4


@dataclass(frozen=True, eq=False)
class Crowd:
    """Sightings of people: position_m, velocity_mps (N, 2)."""

    position_m: FloatArray
    velocity_mps: FloatArray


@dataclass(frozen=True, eq=False)
class TableDrives:
    """crowd: None for a single agent; assumed: sentences about what the table does not state."""

    drives: tuple[RecordedDrive, ...]
    crowd: Crowd | None
    assumed: tuple[str, ...]


def drives_of_table(path: Path, mapping: TableMapping, period_s: float) -> TableDrives:
    """A drive of each agent; FileError where the table cannot be read."""
    found = read_trajectories(path, mapping)
    source = f"table {path}"
    drives = tuple(_drive(track, mapping, period_s, source) for track in found.tracks)
    assumed = found.assumed
    if found.n_bad:
        assumed = (*assumed, f"{found.n_bad} rows without numbers are left out")
    return TableDrives(drives, _crowd(found.tracks), assumed)


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


def _crowd(tracks: tuple[Track, ...]) -> Crowd | None:
    if len(tracks) < 2:
        return None
    return Crowd(
        np.concatenate([track.position_m for track in tracks]),
        np.concatenate([_velocity_mps(track) for track in tracks]),
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
