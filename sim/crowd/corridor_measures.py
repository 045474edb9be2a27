"""Speed, density and passing distance in a corridor: of recorded people and of simulated ones.

The measures are taken in an area of the corridor. Per moment with two people or more: density =
people / area, mean speed, and the smallest distance of centres between two people who walk in
opposite directions.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from serd_core.arrays import FloatArray, IntArray
from sim.crowd.ring_corridor import ring_corridor_crowd
from sim.errors import SimError
from storage.files import read_text

#: All whole numbers below it are exact as floats.
_MOST = 2.0**53


@dataclass(frozen=True, eq=False)
class RecordedPaths:
    """Rows of a recording: person (R,), frame (R,), place_m (R, 2) with x along the corridor."""

    person: IntArray
    frame: IntArray
    place_m: FloatArray
    frames_per_s: float


@dataclass(frozen=True, eq=False)
class CorridorMeasures:
    """(M,) per moment; passing_distance_m is NaN without oncoming people."""

    density_pm2: FloatArray
    speed_mps: FloatArray
    passing_distance_m: FloatArray

    def near_density(self, density_pm2: float, tolerance_pm2: float = 0.13) -> "CorridorMeasures":
        """The moments of about that density."""
        near = np.abs(self.density_pm2 - density_pm2) < tolerance_pm2
        return CorridorMeasures(
            self.density_pm2[near], self.speed_mps[near], self.passing_distance_m[near]
        )


def load_petrack(path: str | Path, frames_per_s: float = 25.0) -> RecordedPaths:
    """Recording in PeTrack's text format: rows `person frame x y z` in centimetres."""
    cells = [line.partition("#")[0].split()[:4] for line in read_text(path).splitlines()]
    try:
        rows = np.array([row for row in cells if row], dtype=np.float64)
    except ValueError as error:
        raise SimError(f"{path} must hold rows of numbers, but {error}; export it again") from None
    if rows.ndim != 2 or rows.shape[1] != 4 or not (np.abs(rows) < _MOST).all():
        raise SimError(
            f"{path} must have rows of person, frame, x and y, all finite, got shape {rows.shape}"
            "; export it from PeTrack as text"
        )
    return RecordedPaths(
        person=rows[:, 0].astype(np.int64),
        frame=rows[:, 1].astype(np.int64),
        place_m=rows[:, 2:4] / 100.0,
        frames_per_s=frames_per_s,
    )


def measure_recording(
    paths: RecordedPaths, *, half_length_m: float = 2.0, width_m: float = 4.0, every: int = 5
) -> CorridorMeasures:
    """Measures of every so-many-th frame within half_length_m of x = 0."""
    velocity = _velocities(paths)
    usable = (np.abs(paths.place_m[:, 0]) < half_length_m) & np.isfinite(velocity[:, 0])
    moments = [
        (paths.place_m[here], velocity[here])
        for frame in np.unique(paths.frame)[::every]
        if (here := np.flatnonzero((paths.frame == frame) & usable)).size >= 2
    ]
    return _measures(moments, 2.0 * half_length_m * width_m)


def measure_simulation(
    density_pm2: float,
    *,
    model_name: str = "circular_anisotropic",
    half_length_m: float = 2.0,
    width_m: float = 4.0,
    length_m: float = 20.0,
    keep_right: bool = True,
    settle_s: float = 20.0,
    duration_s: float = 30.0,
    seed: int = 1,
) -> CorridorMeasures:
    """Measures of two-way traffic in a ring corridor of that density, ten times a second."""
    crowd = ring_corridor_crowd(
        width_m=width_m,
        length_m=length_m,
        density_pm2=density_pm2,
        share_backwards=0.5,
        keep_right=keep_right,
        model_name=model_name,
        rng=np.random.default_rng(seed),
    )
    moments = []
    for step in range(round((settle_s + duration_s) / 0.05)):
        crowd.step(0.05)
        here = crowd.x_m < 2.0 * half_length_m
        if step * 0.05 >= settle_s and step % 2 == 0 and here.sum() >= 2:
            place = np.stack([crowd.x_m, crowd.y_m], axis=1)
            velocity = np.stack([crowd.velocity_x_mps, crowd.velocity_y_mps], axis=1)
            moments.append((place[here], velocity[here]))
    return _measures(moments, 2.0 * half_length_m * width_m)


def _velocities(paths: RecordedPaths, half_window: int = 5) -> FloatArray:
    """(R, 2) central differences over ten frames of each person, NaN at the ends of a path."""
    velocity = np.full_like(paths.place_m, np.nan)
    span_s = 2 * half_window / paths.frames_per_s
    for person in np.unique(paths.person):
        mine = np.flatnonzero(paths.person == person)
        if len(mine) > 2 * half_window:
            moved = paths.place_m[mine[2 * half_window :]] - paths.place_m[mine[: -2 * half_window]]
            velocity[mine[half_window:-half_window]] = moved / span_s
    return velocity


def _measures(moments: list[tuple[FloatArray, FloatArray]], area_m2: float) -> CorridorMeasures:
    return CorridorMeasures(
        density_pm2=np.array([len(place) / area_m2 for place, _ in moments]),
        speed_mps=np.array([np.hypot(*velocity.T).mean() for _, velocity in moments]),
        passing_distance_m=np.array(
            [nearest_opposing_m(place, velocity[:, 0]) for place, velocity in moments]
        ),
    )


def nearest_opposing_m(place_m: FloatArray, along_mps: FloatArray) -> float:
    """Smallest distance between two of (N, 2) places whose walkers go opposite ways; else NaN."""
    away = np.linalg.norm(place_m[:, None] - place_m[None, :], axis=2)
    opposing = along_mps[:, None] * along_mps[None, :] < 0
    return float(away[opposing].min()) if opposing.any() else float("nan")
