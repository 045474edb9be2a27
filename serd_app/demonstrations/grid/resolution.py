"""Which cells and decision periods fit a recording: in what share of periods is a cell crossed?

The outcomes of a grid are the own cell and its four neighbours. Of the periods in which the robot
moves, those that end in a neighbour are completed; with large cells or short periods it stays in
its cell, with small cells or long periods it goes farther than one cell, which no outcome explains.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from serd_app.drives.recorded_drive import RecordedDrive
from serd_core.arrays import BoolArray, FloatArray

#: Share of far moves above which cells are too small, or periods too long.
MOST_FAR = 0.05
#: A grid is as good as the best one where so much less of the moves is completed.
_AS_GOOD = 0.05
_CELLS_M = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 1.25, 1.5, 2.0, 3.0, 5.0)
_USUAL_CELL_M = 0.5
_PERIODS_S = (0.2, 0.4, 0.6, 0.8, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0)
_WIDEST = 3.0
_TURN_RAD = np.pi / 4


@dataclass(frozen=True)
class ResolutionRow:
    """Of n_moving periods in which the robot moves, the shares that end in the own cell, in a
    neighbour (completed), diagonally or farther; used: whether the decisions are cut so."""

    cell_size_m: float
    period_s: float
    n_moving: int
    stayed: float
    completed: float
    diagonal: float
    far: float
    used: int


@dataclass(frozen=True)
class ResolutionAdvice:
    """rows: of all cell sizes and periods. speed_mps, fast_mps: median and 90 % quantile while it
    moves; turning: share of the used periods with a turn above 45 degrees."""

    rows: tuple[ResolutionRow, ...]
    speed_mps: float
    fast_mps: float
    turning: float

    @property
    def used(self) -> ResolutionRow:
        """That of the decisions."""
        return next(row for row in self.rows if row.used)

    @property
    def best(self) -> ResolutionRow:
        """The smallest cells, and with them the shortest period, of those that are as good as the
        best one with few far moves."""
        few = [row for row in self.rows if row.far <= MOST_FAR] or list(self.rows)
        most = max(row.completed for row in few)
        good = [row for row in few if row.completed >= most - _AS_GOOD]
        return min(good, key=lambda row: (row.cell_size_m, row.period_s))

    def sentences(self) -> Iterator[str]:
        """What the recording shows of cells and periods, the advice last."""
        used, best = self.used, self.best
        yield (
            f"while it moves the robot drives {self.speed_mps:.2f} m/s (one in ten above"
            f" {self.fast_mps:.2f}) and turns by more than 45 degrees in"
            f" {_percent(self.turning)} of the periods"
        )
        yield (
            f"cells of {used.cell_size_m:g} m and periods of {used.period_s:g} s: of the moves"
            f" {_percent(used.completed)} end in a neighbouring cell, {_percent(used.stayed)} in"
            f" the own one, {_percent(used.diagonal)} diagonally, {_percent(used.far)} farther"
        )
        if used.far > MOST_FAR or used.completed < best.completed - 2 * _AS_GOOD:
            yield (
                f"cells of {best.cell_size_m:g} m and periods of {best.period_s:g} s fit better:"
                f" {_percent(best.completed)} in a neighbouring cell, {_percent(best.far)} farther"
            )

    @property
    def too_fine(self) -> bool:
        """Whether too many moves go farther than one cell."""
        return self.used.far > MOST_FAR


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %"


def resolution_advice(
    drives: Sequence[RecordedDrive],
    cell_size_m: float,
    period_s: float,
    *,
    origin_m: tuple[float, float] = (0.0, 0.0),
) -> ResolutionAdvice | None:
    """The advice of the episodes of drives; None where the robot never moves a whole period.

    origin_m: a corner of the grid, from which cells of all sizes are cut.
    """
    cells = _near(_CELLS_M, cell_size_m)
    periods = _near(_PERIODS_S, period_s)
    moves = {each: _moves(drives, each, origin_m) for each in periods}
    if not len(moves[period_s]):
        return None
    ends_m = moves[period_s]
    travelled_m = np.linalg.norm(ends_m[:, 1:] - ends_m[:, :-1], axis=2)
    speed_mps = travelled_m.sum(axis=1) / period_s
    return ResolutionAdvice(
        rows=tuple(
            _row(moves[period], cell, period, used=(cell, period) == (cell_size_m, period_s))
            for cell, period in product(cells, periods)
            if len(moves[period])
        ),
        speed_mps=float(np.median(speed_mps)),
        fast_mps=float(np.quantile(speed_mps, 0.9)),
        turning=float(_turned(ends_m).mean()),
    )


def fitting_cell_size_m(drives: Sequence[RecordedDrive], period_s: float) -> float:
    """The cells of which most moves of a period end in a neighbour, and few go farther; 0.5 m where
    the robot never moves a whole period."""
    moves = _moves(drives, period_s, (0.0, 0.0))
    if not len(moves):
        return _USUAL_CELL_M
    rows = [_row(moves, cell, period_s, used=False) for cell in _CELLS_M]
    few = [row for row in rows if row.far <= MOST_FAR] or rows[-1:]
    return max(few, key=lambda row: row.completed).cell_size_m


def _near(known: Sequence[float], used: float) -> list[float]:
    return sorted({used, *(each for each in known if used / _WIDEST <= each <= used * _WIDEST)})


def _moves(
    drives: Sequence[RecordedDrive], period_s: float, origin_m: tuple[float, float]
) -> FloatArray:
    """(N, 3, 2) places at begin, middle and end of the periods in which the robot moves, from the
    origin."""
    found = [np.zeros((0, 3, 2))]
    for drive in drives:
        least_m = drive.minimum_speed_mps * period_s
        for span in drive.episodes:
            if not span.demonstrates:
                continue
            begins_s = np.arange(span.start_s, span.end_s - period_s + 1e-6, period_s)
            at_s = begins_s[:, None] + period_s * np.array([0.0, 0.5, 1.0])
            columns = [np.interp(at_s, drive.pose_time_s, each) for each in drive.position_m.T]
            places_m = np.stack(columns, axis=2) - origin_m
            moved_m = np.linalg.norm(places_m[:, 2] - places_m[:, 0], axis=1)
            found.append(places_m[moved_m >= least_m])
    return np.concatenate(found)


def _row(places_m: FloatArray, cell_size_m: float, period_s: float, *, used: bool) -> ResolutionRow:
    begin, end = (np.floor(places_m[:, at] / cell_size_m) for at in (0, 2))
    steps = np.abs(end - begin)
    total, largest = steps.sum(axis=1), steps.max(axis=1)
    shares = (total == 0, total == 1, (total == 2) & (largest == 1), largest > 1)
    stayed, completed, diagonal, far = (float(each.mean()) for each in shares)
    return ResolutionRow(
        cell_size_m, period_s, len(places_m), stayed, completed, diagonal, far, int(used)
    )


def _turned(places_m: FloatArray) -> BoolArray:
    """(N,) whether the directions of the two halves differ by more than 45 degrees."""
    first, second = (places_m[:, at + 1] - places_m[:, at] for at in (0, 1))
    cross = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    turn_rad = np.abs(np.arctan2(cross, (first * second).sum(axis=1)))
    return np.asarray(turn_rad > _TURN_RAD)
