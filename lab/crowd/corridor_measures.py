"""Speeds and distances of people in a corridor, by density: recorded people and simulated ones.

PedPy measures both alike, in the middle of the corridor: at each moment Voronoi density and speed
there, and for each person there the speed and the distance to the nearest other.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from lab.crowd.ring_corridor import ring_corridor_crowd
from serd_core.arrays import FloatArray
from serd_files.trajectories.read import Track
from serd_sim.errors import SimError

if TYPE_CHECKING:
    import pandas as pd

#: Time on either side over which a velocity is a central difference.
_HALF_WINDOW_S = 0.2
#: Moments that are measured.
_MOMENT_S = 0.2
#: People's centres keep about this distance to walls.
_CLEAR_OF_WALL_M = 0.2
_PEOPLE_IN_RING = 100
#: Densities that differ by less are about the same.
_NEAR_PM2 = 0.13
_STEP_S, _STEPS_PER_FRAME = 0.05, 2


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
    """Of M moments and of P persons at them; passing_distance_m is NaN where none walk opposed.

    density_pm2, speed_mps, passing_distance_m: (M,); person_density_pm2: (P,) at their moments;
    person_speed_mps, nearest_m: (P,).
    """

    density_pm2: FloatArray
    speed_mps: FloatArray
    passing_distance_m: FloatArray
    person_density_pm2: FloatArray
    person_speed_mps: FloatArray
    nearest_m: FloatArray

    def near_density(self, density_pm2: float) -> "CorridorMeasures":
        """The moments of about that density."""
        moments = np.abs(self.density_pm2 - density_pm2) < _NEAR_PM2
        near = np.abs(self.person_density_pm2 - density_pm2) < _NEAR_PM2
        return CorridorMeasures(
            self.density_pm2[moments],
            self.speed_mps[moments],
            self.passing_distance_m[moments],
            self.person_density_pm2[near],
            self.person_speed_mps[near],
            self.nearest_m[near],
        )


def corridor_of(tracks: Sequence[Track], width_m: float | None = None) -> Corridor:
    """The corridor that people walked through: along the axis on which they went farther.

    tracks: as of `corridor_people`; width_m: by those nearest to its walls where not given.
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
    tracks: Sequence[Track], corridor: Corridor | None = None
) -> CorridorMeasures:
    """Measures in the middle of the corridor, found where not given, five times a second."""
    corridor = corridor or corridor_of(tracks)
    pedpy = _pedpy()
    period_s = float(np.median(np.concatenate([np.diff(each.time_s) for each in tracks])))
    every = max(1, round(_MOMENT_S / period_s))
    table = _table(tracks, corridor, period_s)
    half_way_m, across_m = float(np.abs(table["x"]).max()) + 0.1, 0.5 * corridor.width_m
    table = table[np.abs(table["y"]) < across_m]
    people = pedpy.TrajectoryData(table, frame_rate=1.0 / period_s)
    speed = pedpy.compute_individual_speed(
        traj_data=people, frame_step=max(1, round(_HALF_WINDOW_S / period_s)), compute_velocity=True
    )
    moving = people.data.merge(speed, on=["id", "frame"])
    seen = pedpy.TrajectoryData(
        moving[moving["frame"] % every == 0].drop(columns="point"), frame_rate=1.0 / period_s
    )
    cells = pedpy.compute_individual_voronoi_polygons(
        traj_data=seen, walkable_area=pedpy.WalkableArea(_rectangle(half_way_m, across_m))
    )
    area = pedpy.MeasurementArea(_rectangle(corridor.half_length_m, across_m))
    density, parts = pedpy.compute_voronoi_density(
        individual_voronoi_data=cells, measurement_area=area
    )
    mean_speed = pedpy.compute_voronoi_speed(
        traj_data=seen,
        individual_speed=speed,
        individual_voronoi_intersection=parts,
        measurement_area=area,
    )
    return _measures(
        density.merge(mean_speed, on="frame").set_index("frame"),
        seen.data[np.abs(seen.data["x"]) < corridor.half_length_m],
        pedpy.compute_neighbor_distance(
            traj_data=seen, neighborhood=pedpy.compute_neighbors(cells, as_list=False)
        ),
    )


def measure_simulation(
    density_pm2: float,
    *,
    model_name: str = "collision_prediction",
    width_m: float = 4.0,
    share_backwards: float = 0.5,
    keep_right: bool = True,
    settle_s: float = 20.0,
    duration_s: float = 30.0,
    seed: int = 1,
) -> CorridorMeasures:
    """Measures in a ring corridor with so many people per area.

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
    places = []
    for step in range(round((settle_s + duration_s) / _STEP_S)):
        crowd.step(_STEP_S)
        if step * _STEP_S >= settle_s and step % _STEPS_PER_FRAME == 0:
            places.append(crowd.position_m)
    middle_m = (0.5 * length_m, 0.5 * width_m)
    corridor = Corridor(0, middle_m, width_m, share_backwards=share_backwards)
    return measure_recording(_rounds(np.array(places), length_m), corridor)


def _rounds(place_m: FloatArray, length_m: float) -> list[Track]:
    """Each round of each person through the ring as a track, of (T, N, 2) places."""
    time_s: FloatArray = _STEP_S * _STEPS_PER_FRAME * np.arange(len(place_m), dtype=np.float64)
    tracks: list[Track] = []
    for person in range(place_m.shape[1]):
        walked_m = place_m[:, person]
        returns = np.flatnonzero(np.abs(np.diff(walked_m[:, 0])) > 0.5 * length_m) + 1
        for rows in np.split(np.arange(len(time_s)), returns):
            tracks.append(Track(str(len(tracks)), time_s[rows], walked_m[rows]))
    return tracks


def _table(tracks: Sequence[Track], corridor: Corridor, period_s: float) -> "pd.DataFrame":
    """Columns id, frame, x along the corridor and y across it, from its middle.

    Of several rows of one person in a frame, and of several people at one place, there is one.
    """
    import pandas as pd  # takes half a second

    place = np.concatenate([each.position_m for each in tracks]) - corridor.middle_m
    frame = np.concatenate([each.time_s for each in tracks]) / period_s
    first = frame.min()
    table = pd.DataFrame(
        {
            "id": np.repeat(np.arange(len(tracks)), [len(each.time_s) for each in tracks]),
            "frame": np.rint(frame - (first - np.rint(first))).astype(int),
            "x": place[:, corridor.axis],
            "y": place[:, 1 - corridor.axis],
        }
    )
    return table.drop_duplicates(["id", "frame"]).drop_duplicates(["frame", "x", "y"])


def _measures(
    moments: "pd.DataFrame", people: "pd.DataFrame", apart: "pd.DataFrame"
) -> CorridorMeasures:
    """moments: density and speed by frame; people: in the middle; apart: neighbours' distances."""
    moments = moments.loc[np.unique(people["frame"])]
    neighbours = people.merge(apart, on=["id", "frame"])
    # The nearest of all, and the nearest who walk opposed, are neighbours of Voronoi cells.
    nearest = neighbours.groupby(["frame", "id"])["distance"].min().rename("nearest")
    people = people.merge(nearest, on=["frame", "id"])
    others = people[["id", "frame", "v_x"]].rename(columns={"id": "neighbor_id", "v_x": "other"})
    pairs = neighbours.merge(others, on=["neighbor_id", "frame"])
    passing = pairs[pairs["v_x"] * pairs["other"] < 0.0].groupby("frame")["distance"].min()
    return CorridorMeasures(
        density_pm2=moments["density"].to_numpy(),
        speed_mps=moments["speed"].to_numpy(),
        passing_distance_m=passing.reindex(moments.index).to_numpy(dtype=np.float64),
        person_density_pm2=moments["density"].loc[people["frame"]].to_numpy(),
        person_speed_mps=people["speed"].to_numpy(),
        nearest_m=people["nearest"].to_numpy(),
    )


def _rectangle(half_length_m: float, half_width_m: float) -> list[tuple[float, float]]:
    x_m, y_m = half_length_m, half_width_m
    return [(-x_m, -y_m), (x_m, -y_m), (x_m, y_m), (-x_m, y_m)]


def _pedpy() -> Any:
    try:
        import pedpy
    except ImportError:
        raise SimError(
            "crowds are measured by the package pedpy, which is not installed; "
            "run: pip install pedpy (Python 3.11 or later)"
        ) from None
    return pedpy
