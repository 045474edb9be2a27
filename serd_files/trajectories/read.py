"""Tracks of agents from a table of named columns, of a public layout, or with a mapping.

Rows that contradict each other and impossible motion get a sentence each. There rows are counted
from 1, below the line of names.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from serd_bag.errors import FileError
from serd_core.arrays import FloatArray
from serd_files.trajectories.agents import id_columns, in_rows
from serd_files.trajectories.cells import read_cells
from serd_files.trajectories.columns import (
    Cells,
    Rows,
    TableColumns,
    columns_of,
    mapping_of,
    role_of,
    rows_of,
)
from serd_files.trajectories.speed import of_speed

if TYPE_CHECKING:
    import pandas as pd

#: Names of columns that classify agents.
_KINDS = frozenset(["type", "class", "label"])
#: Share of rows, and number of them, above which ids that are in two places are rejected.
_MANY, _FEW = 0.01, 3
_SAME_PLACE_M = 0.1
#: A jump exceeds all of these; the last is a multiple of the median speed.
_JUMP_M, _JUMP_MPS, _TIMES_USUAL = 1.0, 12.0, 10.0
#: Most rows between two jumps that are left out as strays.
_FEW_ROWS = 3
#: Share of steps of a table without ids that lead away and back above which it has several agents:
#: more than so many distances to the nearest of the next rows. At most so many rows are tested.
_MANY_AWAY, _FAR, _LEAST_ROWS_ON, _MOST_ROWS = 0.2, 5.0, 8, 20_000
#: Pause put between episodes whose times overlap, so that agents of one are not seen in another.
_APART_S = 100.0


@dataclass(frozen=True, eq=False)
class Track:
    """One agent: time_s (T,) increasing, position_m (T, 2); kinds: its classes in the table.

    divided_from: the agent that this is a part of, empty where its track has no jump. row: its
    first row in the file, from 1. name: its id in the table; ids may repeat in other episodes.
    """

    agent: str
    time_s: FloatArray
    position_m: FloatArray
    kinds: tuple[str, ...] = ()
    divided_from: str = ""
    row: int = 1
    name: str = ""


@dataclass(frozen=True, eq=False)
class Trajectories:
    """assumed: sentences about assumptions and rows that were left out."""

    tracks: tuple[Track, ...]
    assumed: tuple[str, ...] = ()


def read_trajectories(path: str | Path, wanted: TableColumns | None = None) -> Trajectories:
    """Return the tracks of at least two places; raises FileError where a file holds none."""
    path = Path(path)
    cells = read_cells(path)
    wanted = (wanted or TableColumns()).completed(cells.stated)
    cells, wanted, unused = in_rows(str(path), cells, wanted)
    columns = columns_of(str(path), cells, wanted)
    rows = rows_of(str(path), cells, columns, wanted)
    ids = [mapping_of(cells.names, agent=column) for column in id_columns(cells)]
    points, contradictions = _first_of_each_time(path, rows, ids)
    points, own_clocks = _on_one_clock(points)
    points, strays = _without_strays(points)
    points, jumps = _divided(points, rows.names, has_ids=rows.has_ids or columns["episode"] >= 0)
    assumed = (*own_clocks, *of_speed(path, rows, points, wanted), *contradictions)
    tracks = _tracks(points, rows, _kinds(cells, columns["agent"]))
    if not tracks:
        raise _no_agents(path, rows)
    left_out = [*assumed, *jumps, *strays, *[unused] * bool(unused)]
    if len(rows.bad):
        others = _and_others(len(rows.bad))
        left_out.append(f"row {rows.bad[0] + 1} lacks a number of time, x or y{others}; left out")
    return Trajectories(tracks, tuple(left_out))


def _no_agents(path: Path, rows: Rows) -> FileError:
    n_good = len(rows.frame)
    return FileError(
        f"{path} must hold agents with two places at least, it holds none in"
        f" {n_good + len(rows.bad)} rows, {n_good} of which have numbers; name its columns in a"
        " --mapping file (time:, agent:, x:, y:)"
    )


def _first_of_each_time(
    path: Path, rows: Rows, candidates: Sequence[str]
) -> tuple["pd.DataFrame", tuple[str, ...]]:
    """Return the first row of each time of an agent, sorted by agent and time, and sentences.

    Raises FileError where agents are in two places at one time too often. candidates: mappings of
    columns that may hold the ids, of a table without them.
    """
    frame, names = rows.frame, rows.names
    if frame.empty:
        raise _no_agents(path, rows)
    found = []
    late = frame[frame.groupby("agent").time_s.diff() < 0]
    if len(late):
        found.append(
            f"row {late.row.iloc[0] + 1}, of agent {names[late.agent.iloc[0]]}, goes back in"
            f" time{_and_others(len(late))}; rows are sorted by time"
        )
    points = frame.sort_values(["agent", "time_s"], kind="stable", ignore_index=True)
    step = points.diff()
    again = (step.agent == 0) & (step.time_s == 0)
    both = points.index[again & (np.hypot(step.x, step.y) > _SAME_PLACE_M)]
    if len(both):
        one, other = points.loc[both[0] - 1], points.loc[both[0]]
        what = (
            f"agent {names[int(one.agent)]} is in two places at time {one.time_s:g}, in row"
            f" {one.row + 1:.0f} and row {other.row + 1:.0f}{_and_others(len(both))}"
        )
        if len(both) > max(_FEW, _MANY * len(points)):
            raise _without_ids(path, what, candidates, has_ids=rows.has_ids)
        found.append(f"{what}; the first one counts")
    if not rows.has_ids and (away := _share_away(points)) > _MANY_AWAY:
        what = f"in {100 * away:.0f} % of the steps the place jumps away and comes back"
        raise _without_ids(path, what, candidates, has_ids=False)
    return points[~again], tuple(found)


def _without_ids(path: Path, what: str, candidates: Sequence[str], *, has_ids: bool) -> FileError:
    if has_ids:
        return FileError(
            f"{path}: {what}; give each agent an id of its own, or name the column of ids in a"
            " --mapping file (agent:), or of episodes in which ids begin again (episode:)"
        )
    fix = "add a column of ids, named id, or give each agent as a file"
    if candidates:
        fix = f"name the column of ids in a --mapping file: {' or '.join(candidates)}"
    return FileError(
        f"{path} must have a column of ids where rows are of several agents: {what}; {fix}"
    )


def _share_away(points: "pd.DataFrame") -> float:
    """Return the share of steps that lead farther away than the nearest of the next rows is."""
    points = points.drop_duplicates(["agent", "time_s", "x", "y"])
    share_different = points.time_s.nunique() / len(points)
    rows_on = min(max(_LEAST_ROWS_ON, round(2 / share_different)), 200)
    place_m = points[["x", "y"]].to_numpy()[:_MOST_ROWS]
    count = len(place_m) - rows_on
    if count < 1:
        return 0.0
    away = (place_m[on : count + on] - place_m[:count] for on in range(1, rows_on + 1))
    step, *later = (np.hypot(*moved.T) for moved in away)
    back = np.min(later, axis=0)
    changes = np.abs(np.diff(place_m, axis=0))
    smallest = changes[changes > 0].min(initial=np.inf)
    return float(np.mean(step > _FAR * np.maximum(back, max(np.median(back), smallest))))


def _on_one_clock(points: "pd.DataFrame") -> tuple["pd.DataFrame", tuple[str, ...]]:
    """Return the points without overlaps of episodes, and a sentence where there were some."""
    spans = points.groupby("episode").time_s.agg(["min", "max"])
    ordered = spans.sort_values("min", kind="stable").to_numpy()
    if (ordered[1:, 0] > ordered[:-1, 1]).all():
        return points, ()
    lengths_s = spans["max"] - spans["min"] + _APART_S
    shift_s = spans["min"].iloc[0] - spans["min"] + lengths_s.cumsum().shift(fill_value=0.0)
    sentence = f"times of {len(spans)} episodes overlap, so each has a clock of its own"
    return points.assign(time_s=points.time_s + points.episode.map(shift_s)), (sentence,)


def _steps(points: "pd.DataFrame") -> tuple[Any, Any, Any, Any]:
    """Of the steps to each row, (N,): whether they are of one agent, their length (m), their time
    (s), and whether they are jumps."""
    step = points.diff()
    same, moved_m = step.agent == 0, np.hypot(step.x, step.y)
    speed_mps = moved_m / step.time_s
    usual_mps = speed_mps[same & (moved_m > 0)].median()
    fastest_mps = np.fmax(_JUMP_MPS, _TIMES_USUAL * usual_mps)
    return same, moved_m, step.time_s, same & (moved_m > _JUMP_M) & (speed_mps > fastest_mps)


def _without_strays(points: "pd.DataFrame") -> tuple["pd.DataFrame", tuple[str, ...]]:
    """Return the points that are kept, and a sentence about those that are not.

    Left out between jumps: a few rows, or any number at one place, as -999 or 0 for a lost agent.
    """
    same, _, _, jump = _steps(points)
    piece = (jump | ~same).cumsum()
    pieces = points.groupby(piece)
    few = (pieces.size() <= _FEW_ROWS) | pieces[["x", "y"]].nunique().eq(1).all(axis=1)
    short = piece.map(few)
    stray = short & ~short.groupby(points.agent).transform("all")
    if not stray.any():
        return points, ()
    sentence = (
        f"row {points.row[stray].min() + 1} lies away from where its agent is before and after"
        f"{_and_others(int(stray.sum()))}; left out"
    )
    return points[~stray], (sentence,)


def _divided(
    points: "pd.DataFrame", names: Sequence[str], *, has_ids: bool
) -> tuple["pd.DataFrame", tuple[str, ...]]:
    """Return the points with the number of the part of their agent's track, which jumps divide,
    and a sentence. Without ids nothing is divided."""
    _, moved_m, step_s, jump = _steps(points)
    if not (has_ids and jump.any()):
        return points.assign(part=0), ()
    at = jump.idxmax()
    return points.assign(part=jump.groupby(points.agent).cumsum()), (
        f"row {points.row[at] + 1}: agent {names[points.agent[at]]} jumps {moved_m[at]:.1f} m in"
        f" {step_s[at]:.2g} s{_and_others(int(jump.sum()))}; it counts as another one from there",
    )


def _and_others(number: int) -> str:
    return "" if number == 1 else f", as do {number - 1} other rows"


def _tracks(points: "pd.DataFrame", rows: Rows, kinds: list[list[str]]) -> tuple[Track, ...]:
    """Return a track of each part of an agent that has two points or more."""
    divided = set(points.agent[points.part > 0])
    return tuple(
        Track(
            f"{rows.names[agent]} part {part + 1}" if part else rows.names[agent],
            piece.time_s.to_numpy(),
            piece[["x", "y"]].to_numpy(),
            kinds=tuple(kind[piece.row.iloc[0]] for kind in kinds),
            divided_from=rows.names[agent] if agent in divided else "",
            row=int(piece.row.min()) + 1,
            name=rows.ids[agent],
        )
        for (agent, part), piece in points.groupby(["agent", "part"])
        if len(piece) > 1
    )


def _kinds(cells: Cells, ids: int) -> list[list[str]]:
    """Return the class of each row's agent, by each column of classes or of ids beside the used."""
    return [
        [str(value) for value in cells.frame.iloc[:, column]]
        for column, name in enumerate(cells.names)
        if name.strip().lower() in _KINDS or (role_of(name) == "agent" and column != ids)
    ]
