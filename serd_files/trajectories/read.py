"""Tracks of agents from a table of named columns, of a public layout, or with a mapping."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from serd_bag.errors import FileError
from serd_bag.quantities import counted
from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_files.trajectories.cells import Cells, read_cells
from serd_files.trajectories.columns import TableColumns, mapping_of, role_of
from serd_files.trajectories.faults import (
    and_others,
    faults_of_rows,
    parts_of_jumps,
    without_strays,
)
from serd_files.trajectories.layouts import with_layout
from serd_files.trajectories.places import Columns, columns_of
from serd_files.trajectories.rows import Rows, on_one_clock, rows_of

#: Names of columns that classify agents.
_KINDS = frozenset(["type", "class", "label"])
#: Name of the column that marks the robot, and the values that do.
_FLAG, _TRUE = "is_robot", frozenset(["1", "1.0", "true", "yes"])
#: Half of the shortest step between two stamps.
_SHORTEST_S = 5e-10


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
    """assumed: sentences about assumptions and rows that were left out; n_bad: number of these."""

    tracks: tuple[Track, ...]
    assumed: tuple[str, ...] = ()
    n_bad: int = 0


def read_trajectories(path: str | Path, wanted: TableColumns | None = None) -> Trajectories:
    """Return the tracks of at least two places; raises FileError where a file holds none."""
    path = Path(path)
    cells, wanted = with_layout(read_cells(path), wanted or TableColumns())
    columns = columns_of(str(path), cells, wanted)
    rows = rows_of(str(path), cells, columns, wanted)
    points, assumed = _points(path, rows, _candidates(cells, columns))
    kept, strays = without_strays(points)
    points = points.select(kept)
    part, jumps = np.zeros(len(points.agent), dtype=np.int64), tuple[str, ...]()
    if rows.has_ids or columns.episode >= 0:
        part, jumps = parts_of_jumps(points)
    kinds = _kinds(cells) if columns.pairs.keys() == {""} else []
    tracks = _pieces(points, part, kinds)
    if not tracks:
        raise _no_agents(path, rows)
    left_out = (*strays, *_without_numbers(rows, cells.n_skipped))
    n_bad = int((~rows.good).sum() + (~kept).sum()) + cells.n_skipped
    sentences = (*columns.remarks, *assumed, *jumps, *left_out, *_lists(cells))
    return Trajectories(tracks, sentences, n_bad)


def _no_agents(path: Path, rows: Rows) -> FileError:
    return FileError(
        f"{path} must hold agents with two places at least, it holds none in {len(rows.row)} rows,"
        f" {int(rows.good.sum())} of which have numbers; name its columns in a --mapping file"
        " (time:, agent:, x:, y:)"
    )


def _points(path: Path, rows: Rows, candidates: list[str]) -> tuple[Rows, tuple[str, ...]]:
    """Return the first row of each time of an agent, and sentences about assumptions and faults."""
    by_agent = rows.by_agent
    if not len(by_agent):
        raise _no_agents(path, rows)
    another = np.diff(rows.agent[by_agent]) != 0
    later = np.diff(rows.time_s[by_agent]) > 0
    first = rows.select(by_agent[np.concatenate([[True], another | later])])
    time_s, own_clocks = on_one_clock(first.time_s, first.episode)
    speed_mps = _speed_mps(time_s, first.place_m, np.diff(first.agent) == 0)
    faults = faults_of_rows(path, rows, speed_mps, candidates)
    sentences = (*own_clocks, *_in_words(rows.assumed, speed_mps), *faults)
    return replace(first, time_s=time_s), sentences


def _candidates(cells: Cells, columns: Columns) -> list[str]:
    """Return mappings of the columns that may hold the ids of a table without them."""
    used = {
        columns.time,
        columns.episode,
        *(each for pair in columns.pairs.values() for each in pair),
    }
    return [
        mapping_of(cells.names, agent=column)
        for column, name in enumerate(cells.names)
        if column not in used and role_of(name) is None
    ]


def _pieces(points: Rows, part: IntArray, kinds: list[list[str]]) -> tuple[Track, ...]:
    """Return a track of each part (N,) of an agent that has two points or more."""
    divided = set(points.agent[part > 0].tolist())
    begins = 1 + np.flatnonzero((np.diff(points.agent) != 0) | (np.diff(part) != 0))
    tracks = []
    for piece in np.split(np.arange(len(part)), begins):
        if len(piece) < 2:
            continue
        first = piece[0]
        agent, number = int(points.agent[first]), int(part[first])
        name = points.names[agent]
        tracks.append(
            Track(
                f"{name} part {number + 1}" if number else name,
                points.time_s[piece],
                points.place_m[piece],
                kinds=tuple(kind[points.row[first]] for kind in kinds),
                divided_from=name if agent in divided else "",
                row=int(points.row[piece].min()) + 1,
                name=points.ids[agent],
            )
        )
    return tuple(tracks)


def _without_numbers(rows: Rows, n_skipped: int) -> tuple[str, ...]:
    """Return sentences about rows that were left out."""
    bad = rows.row[~rows.good]
    found = []
    if len(bad):
        others = and_others(len(bad))
        found.append(f"row {bad[0] + 1} lacks a number of time, x or y{others}; left out")
    if n_skipped:
        found.append(f"{counted(n_skipped, 'row')} with more cells than the first left out")
    return tuple(found)


def _lists(cells: Cells) -> tuple[str, ...]:
    """Return sentences about columns of lists, as of the people of a row."""
    found = []
    for column, name in enumerate(cells.names):
        given = cells.frame.iloc[:, column].dropna()
        if len(given) and str(given.iloc[0]).lstrip().startswith(("[", "{")):
            found.append(
                f"column {name} holds lists, which are not read; give people rows or columns of"
                " their own"
            )
    return tuple(found)


def _kinds(cells: Cells) -> list[list[str]]:
    """Return the class of each row's agent, by each column of classes."""
    found = []
    for column, name in enumerate(cells.names):
        plain, given = name.strip().lower(), cells.frame.iloc[:, column]
        if plain in _KINDS:
            found.append([str(value) for value in given])
        elif plain == _FLAG:
            flags = (str(value).strip().lower() in _TRUE for value in given)
            found.append(["robot" if flag else "" for flag in flags])
    return found


def _in_words(units: dict[str, str], speed_mps: float) -> tuple[str, ...]:
    """Return one line about assumed units, by the key that states each, if any are assumed."""
    if not units:
        return ()
    keys = " and ".join(f"'{key}:'" for key in units)
    return (
        f"{' and '.join(units.values())} are assumed (then agents move at {speed_mps:.2g} m/s);"
        f" {keys} in a --mapping file {'state' if len(units) > 1 else 'states'} others",
    )


def _speed_mps(time_s: FloatArray, place_m: FloatArray, same: BoolArray) -> float:
    """Return the median over steps in which an agent moved."""
    step_s = np.diff(time_s)[same]
    moved_m = np.hypot(*np.diff(place_m, axis=0)[same].T)
    moving = (moved_m > 0) & (step_s > _SHORTEST_S)
    return float(np.median(moved_m[moving] / step_s[moving])) if moving.any() else 0.0
