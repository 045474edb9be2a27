"""A grid for a place without a map, with cells and a patience that fit how the robot drives.

Walkable is where the robot has been and around, or an area.
"""

from collections.abc import Sequence

import numpy as np
import shapely

from serd_app.drives.drive import RecordedDrive, places_at
from serd_app.drives.recording import Recording
from serd_app.errors import AppError
from serd_bag.errors import BagError
from serd_core.arrays import FloatArray
from serd_core.grid.grid import Grid
from serd_sim.scenario.scenario import Scenario

#: 1 km² in cells of half a metre; anything larger is a pose gone wrong.
_MOST_CELLS = 4_000_000
#: People farther from the box around all drives are elsewhere.
_PEOPLE_NEAR_M = 5.0


def fitted_grid(recordings: Sequence[Recording], cell_size_m: float) -> Grid:
    """Cells wherever one of the robots, or of the people of a table near them, has been, and
    around."""
    places = [drive.position_m for recording in recordings for drive in recording.drives]
    if not any(len(each) for each in places):
        names = ", ".join(str(recording.bag) for recording in recordings)
        raise AppError(f"{names} must hold a pose to fit a grid to, got none; record some")
    driven_m = np.concatenate(places)
    people = [track.position_m for recording in recordings for track in recording.people]
    people_m = np.concatenate([np.zeros((0, 2)), *people])
    low_m, high_m = driven_m.min(axis=0) - _PEOPLE_NEAR_M, driven_m.max(axis=0) + _PEOPLE_NEAR_M
    near = ((people_m >= low_m) & (people_m <= high_m)).all(axis=1)
    return grid_around(np.concatenate([driven_m, people_m[near]]), cell_size_m)


def grid_around(position_m: FloatArray, cell_size_m: float) -> Grid:
    """Grid whose walkable cells are those of (N, 2) positions and their eight neighbours.

    Cell borders lie on whole multiples of the cell size, so that grids of several bags agree.
    """
    places = np.asarray(position_m, dtype=np.float64)
    _require_one_place(places, cell_size_m)
    low = np.floor(places.min(axis=0) / cell_size_m) - 1
    origin_m = (float(low[0] * cell_size_m), float(low[1] * cell_size_m))
    cells = np.floor((places - origin_m) / cell_size_m).astype(np.int64)
    columns, rows = cells.max(axis=0) + 2
    walkable = np.zeros((rows, columns), dtype=bool)
    for column, row in np.unique(cells, axis=0):
        walkable[row - 1 : row + 2, column - 1 : column + 2] = True
    return Grid(origin_m, cell_size_m, walkable)


def grid_of_area(area: shapely.Polygon, cell_size_m: float) -> Grid:
    """Grid whose walkable cells have their centre in an area; borders as in `grid_around`."""
    x_low, y_low, x_high, y_high = np.array(area.bounds) / cell_size_m
    low = np.floor([x_low, y_low])
    columns, rows = np.ceil([x_high, y_high]) - low
    if rows * columns > _MOST_CELLS:
        raise AppError(
            f"a grid of the area must have at most {_MOST_CELLS} cells, got {rows * columns:.3g};"
            " take larger cells"
        )
    origin_m = (float(low[0] * cell_size_m), float(low[1] * cell_size_m))
    x_m, y_m = (
        start_m + cell_size_m * (np.arange(int(count)) + 0.5)
        for start_m, count in zip(origin_m, (columns, rows), strict=True)
    )
    walkable = shapely.contains_xy(area, *np.meshgrid(x_m, y_m))
    if not walkable.any():
        raise AppError(
            f"cell_size_m must leave a cell whose centre is in the area, got {cell_size_m:g} m;"
            " take smaller cells"
        )
    return Grid(origin_m, cell_size_m, walkable)


def _require_one_place(places: FloatArray, cell_size_m: float) -> None:
    """One pose far away would make a grid that no memory holds, or numbers that overflow."""
    with np.errstate(over="ignore"):
        n_cells = float(np.prod(np.ptp(places, axis=0) / cell_size_m + 1.0))
        if n_cells <= _MOST_CELLS:
            return
        distance_m = np.abs(places - np.median(places, axis=0)).max(axis=1)
    x_m, y_m = places[int(distance_m.argmax())]
    raise BagError(
        f"a grid fitted to the poses must have at most {_MOST_CELLS} cells, theirs would have"
        f" {n_cells:.3g}: the pose ({x_m:g}, {y_m:g}) m lies farthest from the others;"
        " take larger cells, or a scenario, off whose grid poses are dropped and counted"
    )


USUAL_PATIENCE_S: float = Scenario.model_fields["patience_s"].default
USUAL_WAIT_S: float = Scenario.model_fields["wait_s"].default
_CELLS_M = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 1.25, 1.5, 2.0, 3.0, 5.0)
_USUAL_CELL_M = 0.5
_SECOND_S = 1.0
#: The patience is at least so many times the time for a cell at the usual speed.
_PATIENT_CELLS = 3.0


def fitting_cell_size_m(drives: Sequence[RecordedDrive]) -> float:
    """The size that is nearest to the way of a second, as the robot drives while it moves; 0.5 m
    where it never moves."""
    speed_mps = _usual_speed_mps(drives)
    return cell_size_at_m(speed_mps) if speed_mps else _USUAL_CELL_M


def cell_size_at_m(speed_mps: float) -> float:
    """The size that is nearest to the way of a second at a speed."""
    return min(_CELLS_M, key=lambda size_m: abs(np.log(size_m / (speed_mps * _SECOND_S))))


def fitting_patience_s(drives: Sequence[RecordedDrive], cell_size_m: float) -> float:
    """The usual one, or one with which the robot crosses cells of this size as it drives."""
    speed_mps = _usual_speed_mps(drives)
    if not speed_mps:
        return USUAL_PATIENCE_S
    return max(USUAL_PATIENCE_S, float(np.ceil(_PATIENT_CELLS * cell_size_m / speed_mps)))


def _usual_speed_mps(drives: Sequence[RecordedDrive]) -> float:
    """The median of the seconds of episodes in which robots move; 0 where they never do."""
    moving = [np.zeros(0)]
    for drive in drives:
        least_mps = max(drive.minimum_speed_mps, 1e-3)
        for span in (span for span in drive.episodes if span.demonstrates):
            time_s = np.arange(span.start_s, span.end_s + 1e-6, _SECOND_S)
            places_m = places_at(time_s, drive.pose_time_s, drive.position_m)
            speeds_mps = np.hypot(*np.diff(places_m, axis=0).T) / _SECOND_S
            moving.append(speeds_mps[speeds_mps >= least_mps])
    speeds_mps = np.concatenate(moving)
    return float(np.median(speeds_mps)) if len(speeds_mps) else 0.0
