"""When demonstrations crossed from cell to cell, as the table that `serd learn --times` reads.

They count as drives with a look-ahead of one cell. The people per m² of an episode are the mean
number of the others who were seen at its crossings, over the walkable area; 0 where none were.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from serd_app.demonstrations.crossing_table import (
    CrossedPlace,
    Crossing,
    crossings_of_track,
    people_per_m2,
)
from serd_app.demonstrations.recorded import RecordedDemonstrations
from serd_app.drives.episode_spans import EpisodeSpan
from serd_app.drives.recorded_drive import RecordedDrive
from serd_app.drives.recorded_people import Sighting
from serd_app.drives.recording import Recording
from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_core.grid.grid import Grid

#: Of demonstrations, which stop in no cell further ahead.
_LOOKAHEAD_CELLS = 1
_LEAST_POSES = 2
#: Age of a sighting from which on the people around a robot are not known.
_LONGEST_AGE_S = 1.0
_TOLERANCE_S = 1e-6


def crossings_of_recordings(
    found: Sequence[RecordedDemonstrations],
    sightings: Sequence[Sequence[Sighting]],
    grid: Grid,
    flow: IntArray,
) -> list[Crossing]:
    """Of all episodes, numbered from 0; one that several recordings hold counts once.

    Times in which no pose on the grid was recorded for longer than places are interpolated are left
    out.
    """
    place = CrossedPlace(grid, flow, _LOOKAHEAD_CELLS, 0.0)
    rows, seen, number = list[Crossing](), set[bytes](), 0
    for each, people in zip(found, sightings, strict=True):
        for index, drive in enumerate(each.recording.drives):
            around = people_around(each.recording, index, people)
            for span in drive.episodes:
                track = _track(drive, span, grid)
                if not span.demonstrates or track.tobytes() in seen or len(track) < _LEAST_POSES:
                    continue
                seen.add(track.tobytes())
                rows += _of_episode(place, number, drive, track, span, around)
                number += 1
    return rows


def people_around(
    recording: Recording, drive: int, sightings: Sequence[Sighting]
) -> Callable[[FloatArray], list[FloatArray | None]]:
    """From times (T,) to the people (n, 2) around the agent of a drive, None where not known.

    sightings: of a bag; they count where the clock does not go back. A sighting is known until
    `_LONGEST_AGE_S` after it.
    """
    crowd = recording.crowd
    if crowd is not None:
        return lambda asked_s: list(crowd.others_at(drive, asked_s))
    time_s = np.array([one.time_s for one in sightings])
    places_m = (one.people.position_m[:, :2] for one in sightings)
    people_m = [each[np.isfinite(each).all(axis=1)] for each in places_m]
    if np.any(np.diff(time_s) < 0):
        time_s = np.zeros(0)
    return lambda asked_s: _last_seen(asked_s, time_s, people_m)


def _last_seen(
    asked_s: FloatArray, time_s: FloatArray, people_m: Sequence[FloatArray]
) -> list[FloatArray | None]:
    last = np.searchsorted(time_s, asked_s + _TOLERANCE_S, side="right") - 1
    return [
        None if moment < 0 or at_s - time_s[moment] > _LONGEST_AGE_S else people_m[moment]
        for moment, at_s in zip(last.tolist(), asked_s.tolist(), strict=True)
    ]


def _track(drive: RecordedDrive, span: EpisodeSpan, grid: Grid) -> FloatArray:
    """(T, 3) times and places of an episode on the grid."""
    time_s = drive.pose_time_s
    inside = (time_s >= span.start_s) & (time_s <= span.end_s)
    track = np.column_stack([time_s[inside], drive.position_m[inside]])
    return np.asarray(track[grid.states_at(track[:, 1:]) >= 0])


def _of_episode(
    place: CrossedPlace,
    number: int,
    drive: RecordedDrive,
    track: FloatArray,
    span: EpisodeSpan,
    around: Callable[[FloatArray], list[FloatArray | None]],
) -> list[Crossing]:
    decided = np.column_stack([drive.intent_time_s, drive.intent_action])
    decided = decided[(decided[:, 0] >= span.start_s - 1e-6) & (decided[:, 0] <= span.end_s)]
    arrived = span.outcome == "arrived"
    rows = crossings_of_track(place, number, track, decided, arrived=arrived)
    if not rows:
        return []
    entered_s = np.array([row.entered_s for row in rows])
    counts = [len(each) for each in around(entered_s) if each is not None]
    people_pm2 = people_per_m2(place.grid, float(np.mean(counts)) if counts else 0.0)
    seen = _seen_throughout(rows, track[:, 0], drive.longest_gap_s)
    return [
        replace(row, people_pm2=people_pm2) for row, kept in zip(rows, seen, strict=True) if kept
    ]


def _seen_throughout(rows: Sequence[Crossing], time_s: FloatArray, longest_s: float) -> BoolArray:
    """(N,) whether no gap between poses lies in the time of each row."""
    gap = np.flatnonzero(np.diff(time_s) > longest_s)
    entered_s = np.array([row.entered_s for row in rows])
    left_s = entered_s + [row.dwell_s for row in rows]
    overlaps = (time_s[gap + 1] > entered_s[:, None]) & (time_s[gap] < left_s[:, None])
    return np.asarray(~overlaps.any(axis=1))
