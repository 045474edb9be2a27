"""What does not learn rewards: constant velocity, and the social-force model of `serd_sim`.

Both predict one direction of each move and one time of arrival of each person. The directions are
calibrated by how often people of the training folds went each way when a direction was predicted,
the times by the factors between measured and predicted ones.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from lab.crowd.ring_corridor import endless_lane
from lab.experiments.study.people.cross_validation.forecasts import asked_of, horizon_of
from lab.experiments.study.people.problem import AHEAD, DIRECTIONS, neighbours
from lab.experiments.study.people.recordings import Run, Walker
from lab.experiments.study.people.settings import PeopleSettings
from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_core.grid.grid import DIRECTION_VECTORS
from serd_sim.crowd.crowd import Crowd
from serd_sim.crowd.routes import Routes
from serd_sim.crowd.social_force import model_named

CONSTANT_VELOCITY, SOCIAL_FORCE = "constant velocity", "social force"
DISTANCE_OVER_SPEED = "distance over speed"
#: How long one move is simulated, and at which times simulations begin.
_MOVE_S, _EVERY_S = 3.0, 0.5
_SLOWEST_MPS = 0.2


def speed_so_far_mps(walker: Walker, time_s: float) -> float:
    """Progress along the corridor since the first position, per time."""
    moved_m = walker.at(time_s)[0] - walker.position_m[0, 0]
    return float(max(moved_m / max(time_s - walker.time_s[0], 1e-9), _SLOWEST_MPS))


def walker_predictions(run: Run, settings: PeopleSettings) -> dict[str, Any]:
    """Of each walker: directions of the moves after the first cell, and seconds until arrival."""
    seconds, line_m = settings.forecast.simulation_s, run.goal_line_m + settings.grid.hysteresis_m
    asked = [
        asked_of(walker, i, run, settings.grid.observed_cells)
        for i, walker in enumerate(run.walkers)
    ]
    straight, remaining_s = [], []
    for walker, one in zip(run.walkers, asked, strict=True):
        straight.append([_straight(run, walker, j) for j in _moves(run, walker)])
        distance_m = max(line_m - walker.at(one.time_s)[0], 0.0)
        remaining_s.append(distance_m / speed_so_far_mps(walker, one.time_s))
    begins = [
        (float(walker.crossings.entered_s[j]), i, j)
        for i, walker in enumerate(run.walkers)
        for j in _moves(run, walker)
    ]
    forced = {(i, j): AHEAD for _, i, j in begins}
    for start_s, group in _grouped(begins):
        forced.update(_forced_directions(run, start_s, group, seconds))
    horizon_s = horizon_of(asked, settings.forecast)
    arrival = dict.fromkeys(range(len(asked)), horizon_s)
    starts = [(one.time_s, one.walker, 0) for one in asked]
    for start_s, group in _grouped(starts):
        wanted = {i: time_s for time_s, i, _ in group}
        longest_s = min(1.5 * max(remaining_s[i] for i in wanted) + 5.0, horizon_s)
        arrival.update(_forced_arrivals(run, start_s, wanted, line_m, longest_s, seconds))
    return {
        CONSTANT_VELOCITY: {"directions": straight, "arrival_s": remaining_s},
        SOCIAL_FORCE: {
            "directions": [
                [forced[i, j] for j in _moves(run, walker)] for i, walker in enumerate(run.walkers)
            ],
            "arrival_s": [arrival[i] for i in range(len(run.walkers))],
        },
    }


def _moves(run: Run, walker: Walker) -> range:
    """Numbers of the crossings that begin a move, without the first cell and the goal."""
    return range(1, run.arrival_of(walker))


def _grouped(
    begins: list[tuple[float, int, int]],
) -> Iterator[tuple[float, list[tuple[float, int, int]]]]:
    """(time at which a simulation begins, what begins within the next `_EVERY_S`)."""
    groups: dict[int, list[tuple[float, int, int]]] = {}
    for each in begins:
        groups.setdefault(int(each[0] / _EVERY_S), []).append(each)
    for number, group in sorted(groups.items()):
        yield number * _EVERY_S, group


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


def _crowd(run: Run, time_s: float) -> tuple[IntArray, Crowd | None]:
    """Who is there, and the crowd of them in the coordinates of those who are not turned."""
    there = np.array(
        [i for i, w in enumerate(run.walkers) if w.time_s[0] <= time_s <= w.time_s[-1]], np.int64
    )
    if not len(there):
        return there, None
    walkers = [run.walkers[i] for i in there]
    sign = np.array([walker.sign for walker in walkers], dtype=np.float64)
    places = np.array([walker.at(time_s) for walker in walkers]) * sign[:, None]
    velocity = np.array([walker.velocity_mps(time_s) for walker in walkers]) * sign[:, None]
    half_m = run.width_m / 2
    routes = Routes(
        [endless_lane(*each) for each in zip(places[:, 1].tolist(), sign.tolist(), strict=True)]
    )
    routes.place(np.full(len(sign), 1.0 / 6.0))
    crowd = Crowd(
        model=model_named("circular_anisotropic"),
        routes=routes,
        x_m=places[:, 0],
        y_m=places[:, 1],
        desired_speed_mps=np.array([speed_so_far_mps(walker, time_s) for walker in walkers]),
        walls_m=np.array(
            [[[-1e3, -half_m], [1e3, -half_m]], [[1e3, half_m], [-1e3, half_m]]], dtype=np.float64
        ),
        fluctuation_mps2=0.0,
        rng=np.random.default_rng(0),
    )
    for person, (place, speed) in enumerate(zip(places, velocity, strict=True)):
        crowd.move(person, (float(place[0]), float(place[1])), (float(speed[0]), float(speed[1])))
    return there, crowd


def _simulated(run: Run, start_s: float, duration_s: float, step_s: float) -> dict[int, FloatArray]:
    """(T, 2) where each person who is there is simulated to be, ahead and left."""
    there, crowd = _crowd(run, start_s)
    if crowd is None:
        return {}
    sign = np.array([run.walkers[i].sign for i in there], dtype=np.float64)[:, None]
    places = [np.stack([crowd.x_m, crowd.y_m], axis=1) * sign]
    for _ in range(round(duration_s / step_s)):
        crowd.step(step_s)
        places.append(np.stack([crowd.x_m, crowd.y_m], axis=1) * sign)
    return dict(zip(there.tolist(), np.swapaxes(places, 0, 1), strict=True))


def _forced_directions(
    run: Run, start_s: float, group: list[tuple[float, int, int]], step_s: float
) -> dict[tuple[int, int], int]:
    """Each cell is left where the simulated displacement since its entry leads."""
    ways = _simulated(run, start_s, _EVERY_S + _MOVE_S, step_s)
    found = {}
    for entered_s, i, j in group:
        if i in ways:
            begin = round((entered_s - start_s) / step_s)
            moved = run.walkers[i].at(entered_s) + ways[i][begin:] - ways[i][begin]
            found[i, j] = _exit(run, int(run.walkers[i].crossings.state[j]), moved)
    return found


def _forced_arrivals(
    run: Run,
    start_s: float,
    wanted: dict[int, float],
    line_m: float,
    longest_s: float,
    step_s: float,
) -> dict[int, float]:
    """Seconds from each wanted time until the simulated person is at the line."""
    found = {}
    for i, way in _simulated(run, start_s, longest_s, step_s).items():
        if i in wanted:
            late = np.flatnonzero(way[:, 0] >= line_m)
            end_s = start_s + step_s * (late[0] if len(late) else len(way))
            found[i] = float(max(end_s - wanted[i], step_s))
    return found


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
