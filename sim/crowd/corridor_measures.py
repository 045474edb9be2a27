"""Speed, density and passing distance in a corridor: of recorded people and of simulated ones.

The measures are taken in an area of the corridor. Per moment with two people or more: density =
people / area, mean speed, and the smallest distance of centres between two people who walk in
opposite directions.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray
from sim.crowd.ring_corridor import ring_corridor_crowd
from storage.trajectories.read import Track

#: Rows of a track on either side over which its velocity is a central difference.
_HALF_WINDOW = 5


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


def measure_recording(
    tracks: Sequence[Track], *, half_length_m: float = 2.0, width_m: float = 4.0, every: int = 5
) -> CorridorMeasures:
    """Measures of every so-many-th frame within half_length_m of x = 0; x is along the corridor."""
    period_s = float(np.median(np.concatenate([np.diff(each.time_s) for each in tracks])))
    frame = np.concatenate([np.rint(each.time_s / period_s) for each in tracks])
    place = np.concatenate([each.position_m for each in tracks])
    velocity = np.concatenate([_velocities(each) for each in tracks])
    usable = (np.abs(place[:, 0]) < half_length_m) & np.isfinite(velocity[:, 0])
    moments = [
        (place[here], velocity[here])
        for moment in np.unique(frame)[::every]
        if (here := np.flatnonzero((frame == moment) & usable)).size >= 2
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


def _velocities(track: Track) -> FloatArray:
    """(T, 2) central differences, NaN at the ends of the track."""
    velocity = np.full_like(track.position_m, np.nan)
    span = 2 * _HALF_WINDOW
    if len(velocity) > span:
        moved_m = track.position_m[span:] - track.position_m[:-span]
        duration_s = track.time_s[span:] - track.time_s[:-span]
        velocity[_HALF_WINDOW:-_HALF_WINDOW] = moved_m / duration_s[:, None]
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
