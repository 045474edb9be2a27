"""Tracks of agents from a table in text or Parquet: TUM, KITTI, ETH/UCY, PeTrack and plain CSV."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from serd_bag.errors import FileError
from serd_bag.quantities import counted
from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_files.trajectories.cells import Cells, read_cells
from serd_files.trajectories.columns import (
    Columns,
    TableColumns,
    Unit,
    located,
    metres_of,
    numeric,
    times_of,
)
from serd_files.trajectories.episodes import (
    agents_of_episodes,
    episodes_of,
    on_one_clock,
    with_agents,
)
from serd_files.trajectories.faults import (
    Points,
    Rows,
    and_others,
    faults_of_rows,
    parts_of_jumps,
    without_strays,
)
from serd_files.trajectories.wide import long_cells

if TYPE_CHECKING:
    import pandas as pd

_TRANSPOSED_ROWS, _LEAST_TRANSPOSED = 4, 20
#: Larger numbers are discarded; stamps in ns are smaller.
_LARGEST = 1e20
#: Names of columns that classify agents.
_KINDS = frozenset(
    ["type", "class", "category", "kind", "label", "agent_type", "object_type", "obj_type", "role"]
)
#: Names of columns that mark the robot, and the values that do.
_FLAGS, _TRUE = frozenset(["is_robot", "isrobot", "is_ego"]), frozenset(["1", "1.0", "true", "yes"])
#: Half of the shortest step between two stamps.
_SHORTEST_S = 5e-10
_NO_AGENTS = (
    "{path} must hold agents with two places at least, it holds none in {n_rows} rows;"
    " name its columns in a --mapping file (time:, agent:, x:, y:)"
)


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
    """The tracks of at least two places; FileError where a file holds none."""
    path, wanted = Path(path), wanted or TableColumns()
    given = read_cells(path)
    long = long_cells(str(path), given, wanted)
    cells, wanted = long.cells, long.wanted
    values = _numbers(cells.frame)
    if len(values) == _TRANSPOSED_ROWS and values.shape[1] > _LEAST_TRANSPOSED:
        values, cells = values.T, Cells(cells.frame.T, (), cells.fps)
    usable = values[np.isfinite(values).sum(axis=1) >= min(2, values.shape[1])]
    if not len(usable):
        limit = f"of at most {_LARGEST:g} in size"
        raise FileError(f"{path} must hold numbers, it holds none {limit}; check path and unit")
    columns = located(str(path), cells.names, usable, wanted)
    found = _tracks(path, cells, values, columns, wanted)
    return replace(found, assumed=(*long.remarks, *found.assumed, *_lists(given)))


def _tracks(
    path: Path, cells: Cells, values: FloatArray, columns: Columns, wanted: TableColumns
) -> Trajectories:
    """The tracks of rows of agents; FileError where they have none."""
    rows = _identified(path, cells, values, columns)
    if not rows.good.any():
        raise FileError(_NO_AGENTS.format(path=path, n_rows=len(values)))
    points, assumed = _in_m_and_s(path, rows, wanted.fps or cells.fps, wanted.unit)
    kept, strays = without_strays(points)
    points = points.select(kept)
    part, jumps = np.zeros_like(points.agent), tuple[str, ...]()
    if rows.columns.agent >= 0:
        part, jumps = parts_of_jumps(rows.names, points)
    tracks = _pieces(rows, points, part, _kinds(cells))
    if not tracks:
        raise FileError(_NO_AGENTS.format(path=path, n_rows=len(values)))
    left_out = (*strays, *_without_numbers(rows.good, cells.n_skipped))
    n_bad = int((~rows.good).sum() + (~kept).sum()) + cells.n_skipped
    return Trajectories(tracks, (*assumed, *jumps, *left_out), n_bad)


def _identified(path: Path, cells: Cells, values: FloatArray, columns: Columns) -> Rows:
    """The rows with their agents and episodes."""
    time, columns = _time(cells.frame, values, columns)
    place = values[:, [columns.x, columns.y]]
    episode, columns = _divided(path, cells, time, place, columns)
    agent, ids = _agents(cells.frame, columns)
    agent, names, ids = agents_of_episodes(cells, columns, agent, ids, episode)
    return Rows(columns, time, place, agent, episode, names, ids)


def _in_m_and_s(
    path: Path, rows: Rows, fps: float | None, unit: Unit | None
) -> tuple[Points, tuple[str, ...]]:
    """The first row of each time of an agent, and sentences about assumptions and faults."""
    columns, by_agent = rows.columns, rows.by_agent
    another = np.diff(rows.agent[by_agent]) != 0
    later = np.diff(rows.time[by_agent]) > 0
    row = by_agent[np.concatenate([[True], another | later])]
    time, place, agent = rows.time[row], rows.place[row], rows.agent[row]
    same = np.diff(agent) == 0
    time_s, of_time = times_of(columns, time, np.diff(time)[same], fps)
    time_s, own_clocks = on_one_clock(time_s, rows.episode[row])
    speed = _speed(time_s, place, same)
    scale, of_place = metres_of(columns, speed, unit)
    faults = faults_of_rows(path, rows, scale, speed * scale, is_stated=not of_place)
    units = _in_words(of_time | of_place, speed * scale)
    sentences = (*columns.assumed, *own_clocks, *units, *faults)
    return Points(row, agent, time_s, place * scale), sentences


def _pieces(
    rows: Rows, points: Points, part: IntArray, kinds: list[list[str]]
) -> tuple[Track, ...]:
    """A track of each part (N,) of an agent that has two points or more."""
    divided = set(points.agent[part > 0].tolist())
    begins = 1 + np.flatnonzero((np.diff(points.agent) != 0) | (np.diff(part) != 0))
    tracks = []
    for piece in np.split(np.arange(len(part)), begins):
        if len(piece) < 2:
            continue
        first = piece[0]
        agent, number = int(points.agent[first]), int(part[first])
        name = rows.names[agent]
        tracks.append(
            Track(
                f"{name} part {number + 1}" if number else name,
                points.time_s[piece],
                points.place_m[piece],
                kinds=tuple(each[points.row[first]] for each in kinds),
                divided_from=name if agent in divided else "",
                row=int(points.row[piece].min()) + 1,
                name=rows.ids[agent],
            )
        )
    return tuple(tracks)


def _divided(
    path: Path, cells: Cells, time: FloatArray, place: FloatArray, columns: Columns
) -> tuple[IntArray, Columns]:
    """(R,) numbers of episodes, and the columns, with a column of ids where one divides the rows.

    Ids take precedence over times that go back.
    """
    episode, columns = episodes_of(cells, time, columns)
    by_times = columns.agent < 0 and columns.episode < 0 and bool(episode.any())
    try:
        columns = with_agents(path, cells, time, place, columns)
    except FileError:
        if not by_times:
            raise
    return np.zeros_like(episode) if by_times and columns.agent >= 0 else episode, columns


def _without_numbers(good: BoolArray, n_skipped: int) -> tuple[str, ...]:
    """Sentences about rows that were left out."""
    bad = np.flatnonzero(~good)
    found = []
    if len(bad):
        others = and_others(len(bad))
        found.append(f"row {bad[0] + 1} lacks a number of time, x or y{others}; left out")
    if n_skipped:
        found.append(f"{counted(n_skipped, 'row')} with more cells than the first left out")
    return tuple(found)


def _lists(cells: Cells) -> tuple[str, ...]:
    """Sentences about columns of lists, as of the people of a row."""
    found = []
    for row, name in enumerate(cells.names):
        given = cells.frame.iloc[:, row].dropna()
        if len(given) and str(given.iloc[0]).lstrip().startswith(("[", "{")):
            found.append(
                f"column {name} holds lists, which are not read; give people rows or columns of"
                " their own"
            )
    return tuple(found)


def _kinds(cells: Cells) -> list[list[str]]:
    """The class of each row's agent, by each column of classes."""
    found = []
    for row, name in enumerate(cells.names):
        plain, cells_of = name.strip().lower(), cells.frame.iloc[:, row]
        if plain in _KINDS:
            found.append([str(each) for each in cells_of])
        elif plain in _FLAGS:
            given = (str(each).strip().lower() in _TRUE for each in cells_of)
            found.append(["robot" if each else "" for each in given])
    return found


def _numbers(frame: "pd.DataFrame") -> FloatArray:
    """(R, C) with NaN for text and for numbers above `_LARGEST`."""
    columns = [numeric(frame[name]) for name in frame.columns]
    numbers = np.column_stack([column.to_numpy(dtype=np.float64) for column in columns])
    return np.where(np.abs(numbers) <= _LARGEST, numbers, np.nan)


def _in_words(units: dict[str, str], speed_mps: float) -> tuple[str, ...]:
    """One line about assumed units, by the key that states each; none where nothing is assumed."""
    if not units:
        return ()
    keys = " and ".join(f"'{key}:'" for key in units)
    return (
        f"{' and '.join(units.values())} are assumed (then agents move at {speed_mps:.2g} m/s);"
        f" {keys} in a --mapping file {'state' if len(units) > 1 else 'states'} others",
    )


def _time(
    frame: "pd.DataFrame", values: FloatArray, columns: Columns
) -> tuple[FloatArray, Columns]:
    """(R,) as in the file; dates in s."""
    import pandas as pd

    if columns.time < 0:
        return np.arange(len(values), dtype=np.float64), columns
    numbers = values[:, columns.time]
    given = frame.iloc[:, columns.time]
    in_s = replace(columns, frames=False, time_s=1.0)
    if pd.api.types.is_timedelta64_dtype(given):
        return np.asarray(given.dt.total_seconds().to_numpy(dtype=np.float64)), in_s
    if np.isfinite(numbers).any() and not pd.api.types.is_datetime64_any_dtype(given):
        return numbers, columns
    dates = pd.to_datetime(given, errors="coerce", utc=True, format="mixed")
    since = (dates - dates.min()).dt.total_seconds()
    return np.asarray(since.to_numpy(dtype=np.float64)), in_s


def _agents(frame: "pd.DataFrame", columns: Columns) -> tuple[IntArray, list[str]]:
    """(R,) number of the agent, -1 where there is none, and their names."""
    import pandas as pd

    if columns.agent < 0:
        return np.zeros(len(frame), dtype=np.int64), ["0"]
    numbers, names = pd.factorize(frame.iloc[:, columns.agent], sort=True)
    return numbers.astype(np.int64), [
        f"{name:g}" if isinstance(name, float) else str(name) for name in names
    ]


def _speed(time_s: FloatArray, place: FloatArray, same: FloatArray) -> float:
    """Median over steps in which an agent moved, in units of the file per second."""
    step_s = np.diff(time_s)[same]
    moved = np.hypot(*np.diff(place, axis=0)[same].T)
    moving = (moved > 0) & (step_s > _SHORTEST_S)
    return float(np.median(moved[moving] / step_s[moving])) if moving.any() else 0.0
