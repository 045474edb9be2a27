"""What does not learn rewards: constant velocity.

It predicts one direction of each move and one time of arrival of each person. The directions are
calibrated by how often people of the training folds went each way when a direction was predicted,
the times by the factors between measured and predicted ones.
"""

from dataclasses import dataclass

import numpy as np

from lab.experiments.study.people.forecasts import asked_of
from lab.experiments.study.people.problem import AHEAD, DIRECTIONS, neighbours
from lab.experiments.study.people.recordings import Run, Walker
from lab.experiments.study.people.settings import GridSettings
from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_core.grid.grid import DIRECTION_VECTORS

CONSTANT_VELOCITY = "constant velocity"
DISTANCE_OVER_SPEED = "distance over speed"
#: How long one move is extrapolated.
_MOVE_S = 3.0
_SLOWEST_MPS = 0.2


@dataclass(frozen=True, eq=False)
class Straight:
    """(N,) direction of each move, in the order of `moves_of`; (P,) seconds until arrival."""

    directions: IntArray
    arrival_s: FloatArray


def straight_on(runs: tuple[Run, ...], settings: GridSettings) -> Straight:
    """What constant velocity predicts of all walkers of the runs."""
    directions, arrival_s = [], []
    for run in runs:
        line_m = run.goal_line_m + settings.hysteresis_m
        for number, walker in enumerate(run.walkers):
            one = asked_of(walker, number, run, settings.observed_cells)
            directions += [_straight(run, walker, j) for j in range(1, run.arrival_of(walker))]
            distance_m = max(line_m - walker.at(one.time_s)[0], 0.0)
            arrival_s.append(distance_m / speed_so_far_mps(walker, one.time_s))
    return Straight(np.array(directions, dtype=np.int64), np.array(arrival_s))


def speed_so_far_mps(walker: Walker, time_s: float) -> float:
    """Progress along the corridor since the first position, per time."""
    moved_m = walker.at(time_s)[0] - walker.position_m[0, 0]
    return float(max(moved_m / max(time_s - walker.time_s[0], 1e-9), _SLOWEST_MPS))


def _exit(run: Run, cell: int, way: FloatArray) -> int:
    """Direction in which (T, 2) positions leave a cell; ahead where they do not."""
    away = (way - run.grid.centers_m[cell]) / (run.grid.cell_size_m / 2)
    out = np.flatnonzero(np.abs(away).max(axis=1) > 1.0)
    if not len(out):
        return AHEAD
    east, north = away[out[0]]
    steps = DIRECTION_VECTORS[list(DIRECTIONS)]
    order = np.argsort(-(steps @ np.array([east, north])), kind="stable")
    near = run.grid.neighbours[cell, list(DIRECTIONS)]
    return int(next(d for d in order if near[d] != cell))


def _straight(run: Run, walker: Walker, j: int) -> int:
    """At the velocity with which the cell is entered."""
    time_s, cell = float(walker.crossings.entered_s[j]), int(walker.crossings.state[j])
    ahead = np.linspace(0.0, _MOVE_S, 61)[:, None] * walker.velocity_mps(time_s)
    return _exit(run, cell, walker.at(time_s) + ahead)


def confusion(predicted: IntArray, measured: IntArray) -> FloatArray:
    """(4, 4) share of each measured direction given the predicted one, one added to each."""
    counts = np.ones((4, 4))
    np.add.at(counts, (predicted, measured), 1.0)
    return np.asarray(counts / counts.sum(axis=1, keepdims=True))


def free_directions(run: Run) -> BoolArray:
    """(C, 4) mask of the directions that lead to another cell."""
    return np.asarray(neighbours(run) != np.arange(run.grid.n_states)[:, None])


def calibrated(table: FloatArray, predicted: IntArray, free: BoolArray) -> FloatArray:
    """(N, 4) the row of `confusion` of each prediction, on the (N, 4) directions that are free."""
    share = np.where(free, table[predicted], 0.0)
    return np.asarray(share / share.sum(axis=1, keepdims=True))
