"""Speeds and distances of people in a corridor, by density: recorded people and simulated ones.

The measures are taken in the middle of the corridor. At each moment with two people or more there,
density = people / area; each of them counts with its speed and the distance to the nearest other.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray
from sim.crowd.ring_corridor import ring_corridor_crowd
from sim.errors import SimError
from storage.trajectories.read import Track

#: Time on either side over which a velocity is a central difference.
_HALF_WINDOW_S = 0.2
#: People's centres keep about this distance to walls.
_CLEAR_OF_WALL_M = 0.2
_PEOPLE_IN_RING = 100


@dataclass(frozen=True)
class Corridor:
    """A straight corridor. axis: 0 along x, 1 along y; share_backwards: who walks towards less."""

    axis: int
    middle_m: tuple[float, float]
    width_m: float
    half_length_m: float = 2.0
    share_backwards: float = 0.0

    @property
    def flow(self) -> str:
        """One way unless a tenth walks against the others."""
        return "two ways" if 0.1 < self.share_backwards < 0.9 else "one way"


@dataclass(frozen=True, eq=False)
class CorridorMeasures:
    """(P,) per person and moment; (M,) per moment, NaN without people who walk against others."""

    density_pm2: FloatArray
    speed_mps: FloatArray
    nearest_m: FloatArray
    moment_density_pm2: FloatArray
    passing_distance_m: FloatArray

    def near_density(self, density_pm2: float, tolerance_pm2: float = 0.13) -> "CorridorMeasures":
        """The moments of about that density."""
        near = np.abs(self.density_pm2 - density_pm2) < tolerance_pm2
        moments = np.abs(self.moment_density_pm2 - density_pm2) < tolerance_pm2
        return CorridorMeasures(
            self.density_pm2[near],
            self.speed_mps[near],
            self.nearest_m[near],
            self.moment_density_pm2[moments],
            self.passing_distance_m[moments],
        )


def corridor_of(tracks: Sequence[Track], width_m: float | None = None) -> Corridor:
    """The corridor that people walked through: along the axis on which they went farther.

    width_m: by the people who walk nearest to its walls where not given.
    """
    ways_m = np.array([each.position_m[-1] - each.position_m[0] for each in tracks])
    axis = int(np.argmax(np.abs(ways_m).sum(axis=0)))
    place = np.concatenate([each.position_m for each in tracks])
    low, high = place[:, axis].min(), place[:, axis].max()
    if high - low < 4.0:
        raise SimError(
            f"people must walk through a corridor of at least 4 m, they went {high - low:.3g} m; "
            "check the unit of the recording"
        )
    along_m = 0.5 * (low + high)
    within = np.abs(place[:, axis] - along_m) < 0.25 * (high - low)
    right, left = np.quantile(place[within, 1 - axis], (0.005, 0.995))
    middle = (float(along_m), float(0.5 * (right + left)))
    return Corridor(
        axis,
        middle if axis == 0 else middle[::-1],
        width_m or round(float(left - right) + 2.0 * _CLEAR_OF_WALL_M, 1),
        share_backwards=float((ways_m[:, axis] < 0.0).mean()),
    )


def measure_recording(
    tracks: Sequence[Track], corridor: Corridor | None = None, *, every: int = 5
) -> CorridorMeasures:
    """Measures of every so-many-th frame in the middle of the corridor, found where not given."""
    corridor = corridor or corridor_of(tracks)
    period_s = float(np.median(np.concatenate([np.diff(each.time_s) for each in tracks])))
    frame = np.concatenate([np.rint(each.time_s / period_s) for each in tracks])
    place = np.concatenate([each.position_m for each in tracks]) - corridor.middle_m
    rows = max(1, round(_HALF_WINDOW_S / period_s))
    velocity = np.concatenate([_velocities(each, rows) for each in tracks])
    if corridor.axis == 1:
        place, velocity = place[:, ::-1], velocity[:, ::-1]
    usable = (np.abs(place[:, 0]) < corridor.half_length_m) & np.isfinite(velocity[:, 0])
    frame, place, velocity = frame[usable], place[usable], velocity[usable]
    order = np.argsort(frame, kind="stable")
    starts = np.flatnonzero(np.diff(frame[order], prepend=-np.inf))
    groups = np.split(order, starts[1:])[::every] if len(order) else []
    moments = [(place[here], velocity[here]) for here in groups if len(here) >= 2]
    return _measures(moments, 2.0 * corridor.half_length_m * corridor.width_m)


def measure_simulation(
    density_pm2: float,
    *,
    model_name: str = "circular_anisotropic",
    half_length_m: float = 2.0,
    width_m: float = 4.0,
    share_backwards: float = 0.5,
    keep_right: bool = True,
    settle_s: float = 20.0,
    duration_s: float = 30.0,
    seed: int = 1,
) -> CorridorMeasures:
    """Measures in a ring corridor of that density, ten times a second.

    The ring is as long as about 100 people fill it, between 8 and 20 m.
    """
    length_m = float(np.clip(_PEOPLE_IN_RING / (density_pm2 * width_m), 8.0, 20.0))
    crowd = ring_corridor_crowd(
        width_m=width_m,
        length_m=length_m,
        density_pm2=density_pm2,
        share_backwards=share_backwards,
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


def _velocities(track: Track, rows: int) -> FloatArray:
    """(T, 2) central differences over so many rows on either side, NaN at the ends."""
    velocity = np.full_like(track.position_m, np.nan)
    span = 2 * rows
    if len(velocity) > span:
        moved_m = track.position_m[span:] - track.position_m[:-span]
        duration_s = track.time_s[span:] - track.time_s[:-span]
        velocity[rows:-rows] = moved_m / duration_s[:, None]
    return velocity


def _measures(moments: list[tuple[FloatArray, FloatArray]], area_m2: float) -> CorridorMeasures:
    counts = np.array([len(place) for place, _ in moments], dtype=np.int64)
    away = [_away_m(place) for place, _ in moments]
    speeds = [np.hypot(*velocity.T) for _, velocity in moments]
    return CorridorMeasures(
        density_pm2=np.repeat(counts, counts) / area_m2,
        speed_mps=np.concatenate([np.zeros(0), *speeds]),
        nearest_m=np.concatenate([np.zeros(0), *(each.min(axis=1) for each in away)]),
        moment_density_pm2=counts / area_m2,
        passing_distance_m=np.array(
            [
                _nearest_opposing_m(each, velocity[:, 0])
                for each, (_, velocity) in zip(away, moments, strict=True)
            ]
        ),
    )


def _away_m(place_m: FloatArray) -> FloatArray:
    """(N, N) distances of centres, inf to oneself."""
    away: FloatArray = np.linalg.norm(place_m[:, None] - place_m[None, :], axis=2)
    np.fill_diagonal(away, np.inf)
    return away


def _nearest_opposing_m(away_m: FloatArray, along_mps: FloatArray) -> float:
    """Smallest distance between two whose walkers go opposite ways; NaN where there are none."""
    opposing = along_mps[:, None] * along_mps[None, :] < 0
    return float(away_m[opposing].min()) if opposing.any() else float("nan")
