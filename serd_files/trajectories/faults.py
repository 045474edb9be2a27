"""Faults of the rows of a table: contradictions and impossible motion, a sentence for each.

Rows are counted from 1, below the line of names.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path

import numpy as np

from serd_bag.errors import FileError
from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_files.trajectories.columns import Columns

#: Share of rows, and number of them, above which ids that are in two places are rejected.
_MANY, _FEW = 0.01, 3
#: Median speeds (m/s): the highest accepted, the one below which a warning is given, and the lowest
#: accepted.
_FASTEST_MPS, _SLOWEST_MPS, _STILL_MPS = 40.0, 0.02, 0.005
#: A jump exceeds all of these; the last is a multiple of the median speed.
_JUMP_M, _JUMP_MPS, _TIMES_USUAL = 1.0, 12.0, 10.0
_SAME_PLACE_M = 0.1
#: Most rows between two jumps that are left out as strays.
_FEW_ROWS = 3


@dataclass(frozen=True, eq=False)
class Rows:
    """All rows: time, agent, episode (R,), place (R, 2) as in the file; agent: -1 where unknown.

    names: of the agents, ids: theirs in the table, which may repeat in other episodes.
    """

    columns: Columns
    time: FloatArray
    place: FloatArray
    agent: IntArray
    episode: IntArray
    names: list[str]
    ids: list[str]

    @cached_property
    def good(self) -> BoolArray:
        """(R,) those with numbers."""
        return np.isfinite(self.time) & np.isfinite(self.place).all(axis=1) & (self.agent >= 0)

    @cached_property
    def by_agent(self) -> IntArray:
        """(N,) those with numbers, sorted by agent and time."""
        good = np.flatnonzero(self.good)
        return good[np.lexsort((self.time[good], self.agent[good]))]


@dataclass(frozen=True, eq=False)
class Points:
    """Rows with numbers, sorted by agent and increasing time: row (N,) in the file, agent (N,),
    time_s (N,), place_m (N, 2)."""

    row: IntArray
    agent: IntArray
    time_s: FloatArray
    place_m: FloatArray

    def select(self, kept: BoolArray) -> "Points":
        """Those kept (N,)."""
        return Points(self.row[kept], self.agent[kept], self.time_s[kept], self.place_m[kept])


def faults_of_rows(
    path: Path, rows: Rows, scale: float, speed_mps: float, *, is_stated: bool
) -> tuple[str, ...]:
    """Sentences; FileError where one id is in two places too often, or a speed is impossible.

    scale: m per unit of places, is_stated: whether the file or the mapping names the units.
    """
    if 0 < speed_mps < _STILL_MPS:
        raise FileError(
            f"{path}: agents must move, but half of their steps are at {speed_mps:.2g} m/s or"
            " slower; state unit: and time_unit: or fps: in a --mapping file; degrees are no unit"
            " of places"
        )
    if speed_mps > _FASTEST_MPS:
        a, b = _usual_step(rows)
        raise FileError(
            f"{path}: agents must move at less than {_FASTEST_MPS:g} m/s, but half of them move at"
            f" {speed_mps:.3g} m/s or faster, as from row {a} to row {b}; state unit: and fps: in a"
            " --mapping file"
        )
    found = [_out_of_order(rows)]
    if rows.columns.agent >= 0:
        found.append(_in_two_places(path, rows, scale))
    if is_stated and 0 < speed_mps < _SLOWEST_MPS:
        found.append(
            f"agents move at {speed_mps:.2g} m/s only: 'unit:' and 'fps:' in a --mapping file state"
            " other units"
        )
    return tuple(filter(None, found))


def _usual_step(rows: Rows) -> tuple[int, int]:
    """The two rows of the first step that is as long as usual."""
    order = rows.by_agent
    same = np.diff(rows.agent[order]) == 0
    moved = np.hypot(*np.diff(rows.place[order], axis=0).T)
    step = np.flatnonzero(same & (moved >= np.median(moved[same & (moved > 0)])))[0]
    return int(order[step]) + 1, int(order[step + 1]) + 1


def _out_of_order(rows: Rows) -> str:
    good = np.flatnonzero(rows.good)
    order = good[np.argsort(rows.agent[good], kind="stable")]
    back = (np.diff(rows.agent[order]) == 0) & (np.diff(rows.time[order]) < 0)
    late = np.sort(order[1:][back])
    if not len(late):
        return ""
    return (
        f"row {late[0] + 1}, of agent {rows.names[rows.agent[late[0]]]}, goes back in time"
        f"{and_others(len(late))}; rows are sorted by time"
    )


def _in_two_places(path: Path, rows: Rows, scale: float) -> str:
    order = rows.by_agent
    again = (np.diff(rows.agent[order]) == 0) & (np.diff(rows.time[order]) == 0)
    apart = np.hypot(*np.diff(rows.place[order], axis=0).T) * scale > _SAME_PLACE_M
    both = np.flatnonzero(again & apart)
    if not len(both):
        return ""
    one, other = order[both[0]], order[both[0] + 1]
    what = (
        f"agent {rows.names[rows.agent[one]]} is in two places at time {rows.time[one]:g}, in row"
        f" {one + 1} and row {other + 1}"
    )
    if len(both) > max(_FEW, _MANY * len(order)):
        raise FileError(
            f"{path}: {what}{and_others(len(both))}; give each agent an id of its own, or name the"
            " column of ids in a --mapping file (agent:), or of episodes in which ids begin again"
            " (episode:)"
        )
    return f"{what}{and_others(len(both))}; the first one counts"


def parts_of_jumps(names: Sequence[str], points: Points) -> tuple[IntArray, tuple[str, ...]]:
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
        f"row {points.row[at + 1] + 1}: agent {names[points.agent[at]]} jumps"
        f" {moved_m[at]:.1f} m in {step_s[at]:.2g} s{and_others(len(where))};"
        " it counts as another one from there",
    )


def without_strays(points: Points) -> tuple[BoolArray, tuple[str, ...]]:
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


def _steps(points: Points) -> tuple[BoolArray, FloatArray, FloatArray, BoolArray]:
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
