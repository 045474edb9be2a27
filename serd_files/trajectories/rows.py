"""The rows of a table: a place in metres at a time in seconds of an agent in an episode."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from serd_bag.errors import FileError
from serd_core.arrays import FloatArray, IntArray
from serd_files.trajectories.cells import Cells
from serd_files.trajectories.columns import (
    METRES,
    Columns,
    TableColumns,
    numeric,
    role_of,
    unit_of,
)

if TYPE_CHECKING:
    import pandas as pd

SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
#: Least sizes of times since 1970 in ms, us and ns; in s they are below all of them.
_SINCE_1970 = ((1e17, "ns"), (1e14, "us"), (1e11, "ms"))
#: Pause put between episodes whose times overlap, so that agents of one are not seen in another.
_APART_S = 100.0


@dataclass(frozen=True, eq=False)
class Rows:
    """frame: row in the file from 0, agent, episode, time_s, x and y (m) of rows that have numbers;
    bad: (B,) the other rows.

    names: of the agents, ids: theirs in the table, which may repeat in other episodes. has_ids:
    whether a column divides the rows into agents. assumed: what the table does not state, by the
    key of a mapping that states it.
    """

    frame: "pd.DataFrame"
    bad: IntArray
    names: list[str]
    ids: list[str]
    has_ids: bool
    assumed: dict[str, str]


def rows_of(where: str, cells: Cells, columns: Columns, wanted: TableColumns) -> Rows:
    """Return the rows of all agents; raises FileError where a rate or a unit is not stated."""
    import pandas as pd

    time_s, of_time = _seconds(where, cells, columns.time, wanted)
    scales, of_place = _metres(where, cells, columns, wanted)
    episode, labels = _episodes(cells, columns)
    agent, ids = np.zeros(len(cells.frame), dtype=np.int64), ["0"]
    if has_ids := columns.agent >= 0:
        agent, ids = _numbered(cells.frame.iloc[:, columns.agent])
    x, y = (
        scale * numeric(cells.frame.iloc[:, column])
        for column, scale in zip((columns.x, columns.y), scales, strict=True)
    )
    rows = pd.DataFrame(
        {
            "row": cells.frame.index.to_numpy(),
            "agent": agent,
            "episode": episode,
            "time_s": time_s,
            "x": x,
            "y": y,
        }
    )
    good = np.isfinite(rows[["time_s", "x", "y"]]).all(axis=1) & (rows.agent >= 0)
    bad, rows = rows.row[~good].to_numpy(), rows[good].reset_index(drop=True)
    names = ids
    if labels:
        word = cells.names[columns.episode]
        key = ["agent", "episode"]
        pairs = rows[key].drop_duplicates().sort_values(key).to_numpy().tolist()
        ids = [ids[agent] for agent, _ in pairs]
        names = of_episode = [labels[number] for _, number in pairs]
        if has_ids:
            names = [
                f"{name} of {word} {label}" for name, label in zip(ids, of_episode, strict=True)
            ]
        rows["agent"] = rows.groupby(key).ngroup()
    return Rows(rows, bad, names, ids, has_ids, of_time | of_place)


def _seconds(
    where: str, cells: Cells, column: int, wanted: TableColumns
) -> tuple[FloatArray, dict[str, str]]:
    """Return the times, NaN where there is none, and what of their unit is assumed.

    Durations and dates are counted from the first one.
    """
    import pandas as pd

    given, name = cells.frame.iloc[:, column], cells.names[column]
    if pd.api.types.is_timedelta64_dtype(given):
        return np.asarray(given.dt.total_seconds().to_numpy(dtype=np.float64)), {}
    numbers = numeric(given)
    is_date = pd.api.types.is_datetime64_any_dtype(given)
    is_number = pd.api.types.is_numeric_dtype(given) or np.isfinite(numbers).any()
    if is_date or not is_number:
        dates = pd.to_datetime(given, errors="coerce", utc=True, format="mixed")
        since = (dates - dates.min()).dt.total_seconds()
        return np.asarray(since.to_numpy(dtype=np.float64)), {}
    unit = wanted.time_unit or unit_of(name)
    if unit in SECONDS:
        return numbers * SECONDS[unit], {}
    if wanted.fps is not None:
        return numbers / wanted.fps, {}
    if role_of(name) == "frame":
        raise FileError(
            f"{where} has frames in the column {name} and does not state how many there are per"
            " second; write their rate into a --mapping file, for example {fps: 16}"
        )
    size = np.nanmedian(np.abs(numbers)) if np.isfinite(numbers).any() else 0.0
    unix = next((unit for least, unit in _SINCE_1970 if size > least), None)
    return numbers * SECONDS[unix or "s"], {} if unix else {"time_unit": "times in s"}


def _metres(
    where: str, cells: Cells, columns: Columns, wanted: TableColumns
) -> tuple[tuple[float, ...], dict[str, str]]:
    """Return the factors of x and y, and what of their unit is assumed."""
    names = cells.names[columns.x], cells.names[columns.y]
    units = [wanted.unit or unit_of(name) for name in names]
    silent = [name for name, unit in zip(names, units, strict=True) if unit not in METRES]
    if len(silent) == 1:
        (stated,) = (unit for unit in units if unit in METRES)
        raise FileError(
            f"{where} must state the units of x and y or of none, that of {silent[0]} is not"
            " stated; write it behind the name, as in x [m], or that of both into a --mapping"
            f" file: {{unit: {stated}}}"
        )
    scales = tuple(METRES.get(unit or "m", 1.0) for unit in units)
    return scales, {"unit": "places in m"} if silent else {}


def _episodes(cells: Cells, columns: Columns) -> tuple[IntArray, list[str]]:
    """Return the number of the episode of each row, and their names, none where there is one."""
    if columns.episode < 0:
        return np.zeros(len(cells.frame), dtype=np.int64), []
    episode, labels = _numbered(cells.frame.iloc[:, columns.episode])
    return (episode, labels) if len(labels) > 1 else (0 * episode, [])


def _numbered(column: "pd.Series[Any]") -> tuple[IntArray, list[str]]:
    """Return the number of each row's name, -1 where there is none, and the names in order."""
    import pandas as pd

    numbers, names = pd.factorize(column, sort=True)
    texts = [f"{name:g}" if isinstance(name, float) else str(name) for name in names]
    return numbers.astype(np.int64), texts


def on_one_clock(points: "pd.DataFrame") -> tuple["pd.DataFrame", tuple[str, ...]]:
    """Return the points without overlaps of episodes, and a sentence where there were some."""
    spans = points.groupby("episode").time_s.agg(["min", "max"])
    ordered = spans.sort_values("min", kind="stable").to_numpy()
    if (ordered[1:, 0] > ordered[:-1, 1]).all():
        return points, ()
    lengths_s = spans["max"] - spans["min"] + _APART_S
    shift_s = spans["min"].iloc[0] - spans["min"] + lengths_s.cumsum().shift(fill_value=0.0)
    sentence = f"times of {len(spans)} episodes overlap, so each has a clock of its own"
    return points.assign(time_s=points.time_s + points.episode.map(shift_s)), (sentence,)
