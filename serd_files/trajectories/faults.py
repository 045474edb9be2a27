"""Faults of the rows of a table: contradictions and impossible motion, a sentence for each.

Rows are counted from 1, below the line of names.
"""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from serd_bag.errors import FileError
from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_files.trajectories.rows import Rows

#: Share of rows, and number of them, above which ids that are in two places are rejected.
_MANY, _FEW = 0.01, 3
#: Median speeds (m/s): the highest accepted, the one below which a warning is given, and the lowest
#: accepted.
_FASTEST_MPS, _SLOWEST_MPS, _STILL_MPS = 40.0, 0.02, 0.005
#: A jump exceeds all of these; the last is a multiple of the median speed.
_JUMP_M, _JUMP_MPS, _TIMES_USUAL = 1.0, 12.0, 10.0
_SAME_PLACE_M = 0.1
#: Share of steps of a table without ids that lead away and back above which it has several agents:
#: more than so many distances to the nearest of the next rows. At most so many rows are tested.
_MANY_AWAY, _FAR, _LEAST_ROWS_ON, _MOST_ROWS = 0.2, 5.0, 8, 20_000
#: Most rows between two jumps that are left out as strays.
_FEW_ROWS = 3


def faults_of_rows(
    path: Path, rows: Rows, speed_mps: float, candidates: Sequence[str]
) -> tuple[str, ...]:
    """Return sentences about faults; raises FileError for impossible speeds, and where agents are
    in two places at one time too often.

    candidates: mappings of columns that may hold the ids, of a table without them.
    """
    if 0 < speed_mps < _STILL_MPS:
        raise FileError(
            f"{path}: agents must move, but half of their steps are at {speed_mps:.2g} m/s or"
            " slower; state unit: and time_unit: or fps: in a --mapping file; degrees are no unit"
            " of places"
        )
    in_two_places = _in_two_places(path, rows, candidates)
    if not rows.has_ids and (away := _share_away(rows)) > _MANY_AWAY:
        what = f"in {100 * away:.0f} % of the steps the place jumps away and comes back"
        raise _without_ids(path, what, candidates)
    if speed_mps > _FASTEST_MPS:
        raise FileError(
            f"{path}: agents must move at less than {_FASTEST_MPS:g} m/s, but half of them move at"
            f" {speed_mps:.3g} m/s or faster; state unit: and time_unit: or fps: in a --mapping"
            " file" + ("" if rows.has_ids else ", or the column of ids by agent:")
        )
    found = [_out_of_order(rows), in_two_places]
    if "unit" not in rows.assumed and 0 < speed_mps < _SLOWEST_MPS:
        found.append(
            f"agents move at {speed_mps:.2g} m/s only: 'unit:' and 'fps:' in a --mapping file state"
            " other units"
        )
    return tuple(filter(None, found))


def _out_of_order(rows: Rows) -> str:
    good = np.flatnonzero(rows.good)
    order = good[np.argsort(rows.agent[good], kind="stable")]
    back = (np.diff(rows.agent[order]) == 0) & (np.diff(rows.time_s[order]) < 0)
    late = np.sort(order[1:][back])
    if not len(late):
        return ""
    return (
        f"row {rows.row[late[0]] + 1}, of agent {rows.names[rows.agent[late[0]]]}, goes back in"
        f" time{and_others(len(late))}; rows are sorted by time"
    )


def _in_two_places(path: Path, rows: Rows, candidates: Sequence[str]) -> str:
    order = rows.by_agent
    again = (np.diff(rows.agent[order]) == 0) & (np.diff(rows.time_s[order]) == 0)
    apart = np.hypot(*np.diff(rows.place_m[order], axis=0).T) > _SAME_PLACE_M
    both = np.flatnonzero(again & apart)
    if not len(both):
        return ""
    one, other = order[both[0]], order[both[0] + 1]
    what = (
        f"agent {rows.names[rows.agent[one]]} is in two places at time {rows.time_s[one]:g}, in row"
        f" {rows.row[one] + 1} and row {rows.row[other] + 1}{and_others(len(both))}"
    )
    if len(both) <= max(_FEW, _MANY * len(order)):
        return f"{what}; the first one counts"
    if rows.has_ids:
        raise FileError(
            f"{path}: {what}; give each agent an id of its own, or name the column of ids in a"
            " --mapping file (agent:), or of episodes in which ids begin again (episode:)"
        )
    raise _without_ids(path, what, candidates)


def _without_ids(path: Path, what: str, candidates: Sequence[str]) -> FileError:
    fix = "add a column of ids, named id, or give each agent as a file"
    if candidates:
        fix = f"name the column of ids in a --mapping file: {' or '.join(candidates)}"
    return FileError(
        f"{path} must have a column of ids where rows are of several agents: {what}; {fix}"
    )


def _share_away(rows: Rows) -> float:
    """Return the share of steps that lead farther away than the nearest of the next rows is."""
    order = rows.by_agent
    points = np.column_stack([rows.agent, rows.time_s, rows.place_m])[order]
    _, first = np.unique(points, axis=0, return_index=True)  # rows that repeat others
    place_m = points[np.sort(first)][:_MOST_ROWS, 2:]
    share_different = len(np.unique(points[:, 1])) / len(points)
    rows_on = min(max(_LEAST_ROWS_ON, round(2 / share_different)), 200)
    count = len(place_m) - rows_on
    if count < 1:
        return 0.0
    away = (place_m[on : count + on] - place_m[:count] for on in range(1, rows_on + 1))
    step, *later = (np.hypot(*each.T) for each in away)
    back = np.min(later, axis=0)
    changes = np.abs(np.diff(place_m, axis=0))
    smallest = changes[changes > 0].min(initial=np.inf)
    return float(np.mean(step > _FAR * np.maximum(back, max(np.median(back), smallest))))


def parts_of_jumps(points: Rows) -> tuple[IntArray, tuple[str, ...]]:
    """(N,) number of the part of each agent's track, which jumps divide, and a sentence."""
    same, moved_m, step_s, jump = _steps(points)
    total = np.concatenate([[0], np.cumsum(jump)])
    first = np.concatenate([[0], np.flatnonzero(~same) + 1])
    part = total - total[first][np.cumsum(np.concatenate([[0], ~same]))]
    where = np.flatnonzero(jump)
    if not len(where):
        return part, ()
    at = int(where[0])
    return part, (
        f"row {points.row[at + 1] + 1}: agent {points.names[points.agent[at]]} jumps"
        f" {moved_m[at]:.1f} m in {step_s[at]:.2g} s{and_others(len(where))};"
        " it counts as another one from there",
    )


def without_strays(points: Rows) -> tuple[BoolArray, tuple[str, ...]]:
    """(N,) whether a row is kept, and a sentence about those that are not.

    Left out between jumps: a few rows, or any number at one place, as -999 or 0 for a lost agent.
    """
    agent, place_m = points.agent, points.place_m
    kept = np.ones(len(agent), dtype=bool)
    same, _, _, jump = _steps(points)
    if not jump.any():
        return kept, ()
    edges = np.concatenate([[0], np.flatnonzero(jump | ~same) + 1, [len(agent)]])
    of_agent: dict[int, list[tuple[int, int]]] = {}
    for piece in pairwise(edges.tolist()):
        of_agent.setdefault(int(agent[piece[0]]), []).append(piece)
    for pieces in of_agent.values():
        fixed = [bool((np.ptp(place_m[begin:end], axis=0) == 0).all()) for begin, end in pieces]
        short = [
            stays or end - begin <= _FEW_ROWS
            for stays, (begin, end) in zip(fixed, pieces, strict=True)
        ]
        if all(short):
            continue
        for begin, end in (each for each, few in zip(pieces, short, strict=True) if few):
            kept[begin:end] = False
    away = np.sort(points.row[~kept])
    if not len(away):
        return kept, ()
    return kept, (
        f"row {away[0] + 1} lies away from where its agent is before and after"
        f"{and_others(len(away))}; left out",
    )


def _steps(points: Rows) -> tuple[BoolArray, FloatArray, FloatArray, BoolArray]:
    """Of the steps from a row to the next, (N - 1,) each: whether they are of one agent, their
    length (m), their time (s), and whether they are jumps."""
    same = np.diff(points.agent) == 0
    moved_m, step_s = np.hypot(*np.diff(points.place_m, axis=0).T), np.diff(points.time_s)
    speed = np.divide(moved_m, step_s, out=np.zeros_like(moved_m), where=same & (step_s > 0))
    moving = speed[same & (moved_m > 0)]
    fastest = max(_JUMP_MPS, _TIMES_USUAL * float(np.median(moving)) if len(moving) else 0.0)
    jump = np.asarray(same & (moved_m > _JUMP_M) & (speed > fastest))
    return same, moved_m, step_s, jump


def and_others(number: int) -> str:
    return "" if number == 1 else f", as do {number - 1} other rows"
