"""How people who come head-on give way to each other, and to a robot that goes straight on.

Two meet head-on where, 3 m apart along the corridor, their ways are less than 0.4 m apart. Measured
are how far they are apart when they pass, and how far each has moved aside from there on.
"""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from lab.crowd.corridor_measures import Corridor
from lab.crowd.ring_corridor import ring_corridor_crowd
from lab.experiments.running.tables import Row
from serd_core.arrays import FloatArray, IntArray
from serd_files.trajectories.read import Track
from serd_sim.crowd.robots import RobotBody

SEEN_M, HEAD_ON_M = 3.0, 0.4
#: Who walks slower along the corridor is not counted.
_WALKS_MPS = 0.3
_STEP_S, _SETTLE_STEPS = 0.05, 240
_LENGTH_M, _WIDTH_M, _ROBOT_MPS, _ROBOT_RADIUS_M = 20.0, 4.0, 1.2, 0.25
ROBOT = -1
#: Ids, x along and y across the corridor, and velocity along it, of those at one moment.
Moment = tuple[IntArray, FloatArray, FloatArray, FloatArray]


def head_on(moments: Iterable[Moment], meets: int | None = None) -> FloatArray:
    """(n, 2) distance when passing and way aside (m) of each of two who meet head-on.

    meets: the id of one of the two in all meetings, whose way aside does not count; None for any.
    """
    begun: dict[tuple[int, int], tuple[float, float]] = {}
    found = list[tuple[float, float]]()
    for ids, x_m, y_m, along_mps in moments:
        at_m = dict(zip(ids.tolist(), x_m.tolist(), strict=True))
        # Who is no longer near, as where a ring is cut in between, meets anew.
        for one, other in [*begun]:
            if abs(at_m.get(one, np.nan) - at_m.get(other, np.nan)) >= SEEN_M:
                del begun[one, other]
        forward, back = (np.flatnonzero(sign * along_mps > _WALKS_MPS) for sign in (1.0, -1.0))
        gap_m = x_m[back] - x_m[forward][:, None]
        for i, j in np.argwhere(np.abs(gap_m) < SEEN_M):
            one, other = int(forward[i]), int(back[j])
            pair = int(ids[one]), int(ids[other])
            if meets is not None and meets not in pair:
                continue
            apart_m = abs(float(y_m[one] - y_m[other]))
            if gap_m[i, j] > 0.0:
                if pair not in begun and gap_m[i, j] > SEEN_M - 0.5 and apart_m < HEAD_ON_M:
                    begun[pair] = float(y_m[one]), float(y_m[other])
            elif pair in begun:
                aside_m = np.abs(np.subtract(begun.pop(pair), (y_m[one], y_m[other])))
                found += [
                    (apart_m, float(aside))
                    for who, aside in zip(pair, aside_m, strict=True)
                    if who != meets
                ]
    return np.array(found, dtype=np.float64).reshape(-1, 2)


def recorded_moments(tracks: Sequence[Track], corridor: Corridor) -> Iterator[Moment]:
    """The moments of a recording in a corridor, whose frames are those of its tracks."""
    rows = np.concatenate(
        [
            np.stack(
                [
                    track.time_s,
                    np.full(len(track.time_s), float(number)),
                    track.position_m[:, corridor.axis],
                    track.position_m[:, 1 - corridor.axis],
                    np.gradient(track.position_m[:, corridor.axis], track.time_s),
                ],
                axis=1,
            )
            for number, track in enumerate(tracks)
        ]
    )
    rows = rows[np.argsort(rows[:, 0], kind="stable")]
    for part in np.split(rows, np.flatnonzero(np.diff(rows[:, 0]) > 1e-6) + 1):
        yield part[:, 1].astype(np.int64), part[:, 2], part[:, 3], part[:, 4]


def simulated_moments(
    model: str, *, density_pm2: float, robot: bool, seed: int, duration_s: float = 50.0
) -> Iterator[Moment]:
    """Two-way flow in a ring corridor 4 m wide; a robot goes straight on in its middle."""
    crowd = ring_corridor_crowd(
        width_m=_WIDTH_M, length_m=_LENGTH_M, density_pm2=density_pm2, share_backwards=0.5,
        keep_right=True, model_name=model, rng=np.random.default_rng(seed),
    )  # fmt: skip
    ids, robot_x_m = np.arange(len(crowd)), 0.0
    ids = np.append(ids, ROBOT) if robot else ids
    for step in range(round(duration_s / _STEP_S)):
        robot_x_m = (robot_x_m + _ROBOT_MPS * _STEP_S) % _LENGTH_M
        body = RobotBody(robot_x_m, 0.5 * _WIDTH_M, _ROBOT_MPS, 0.0, _ROBOT_RADIUS_M)
        crowd.step(_STEP_S, body if robot else None)
        if robot:
            crowd.push_out_of(body)
        if step < _SETTLE_STEPS:
            continue
        # The ring is cut opposite the robot, so that nobody crosses the cut near it.
        x_m = (crowd.x_m - robot_x_m + 0.5 * _LENGTH_M) % _LENGTH_M
        y_m, along_mps = crowd.y_m, crowd.velocity_x_mps
        if robot:
            x_m, y_m = np.append(x_m, 0.5 * _LENGTH_M), np.append(y_m, body.y_m)
            along_mps = np.append(along_mps, _ROBOT_MPS)
        yield ids, x_m, y_m, along_mps


def meetings_row(who: str, found: FloatArray, n_aside: int = 2) -> Row:
    """Quantiles of the distances when passing, and the mean way aside.

    found: of `head_on`; n_aside: how many of the two who meet have a row in it.
    """
    low, median, high = np.quantile(found[:, 0], (0.05, 0.5, 0.95))
    aside_m = float(found[:, 1].mean())
    row: Row = {"who": who, "meetings": len(found) // n_aside, "passing_5_m": float(low)}
    return row | {"passing_m": float(median), "passing_95_m": float(high), "aside_m": aside_m}
