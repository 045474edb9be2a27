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
#: Fewest rows per episode.
_FEWEST_ROWS = 5
#: Smallest share of an episode by which time goes back where the next one begins.
_BACK = 0.5
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

    frame, has_ids = cells.frame, columns["agent"] >= 0
    time_s, of_time = _seconds(where, cells, columns["time"], wanted)
    scale, of_place = _metres(where, cells, columns, wanted)
    episode, labels = _episodes(cells, columns, time_s)
    agent, ids = np.zeros(len(frame), dtype=np.int64), ["0"]
    if has_ids:
        agent, ids = _numbered(frame.iloc[:, columns["agent"]])
    x, y = (scale[axis] * numeric(frame.iloc[:, columns[axis]]) for axis in "xy")
    numbers = {"agent": agent, "episode": episode, "time_s": time_s, "x": x, "y": y}
    rows = pd.DataFrame({"row": np.arange(len(frame)), **numbers})
    good = np.isfinite(rows[["time_s", "x", "y"]]).all(axis=1) & (rows.agent >= 0)
    bad, rows = rows.row[~good].to_numpy(), rows[good].reset_index(drop=True)
    names = ids
    if labels:
        word = cells.names[columns["episode"]] if columns["episode"] >= 0 else "episode"
        key = ["agent", "episode"]
        pairs = rows[key].drop_duplicates().sort_values(key).to_numpy().tolist()
        ids = [ids[agent] for agent, _ in pairs]
        names = [labels[number] for _, number in pairs]
        if has_ids:
            names = [f"{own} of {word} {label}" for own, label in zip(ids, names, strict=True)]
        rows["agent"] = rows.groupby(key).ngroup()
    return Rows(rows, bad, names, ids, has_ids, of_time | of_place)


def _seconds(
    where: str, cells: Cells, column: int, wanted: TableColumns
) -> tuple[FloatArray, dict[str, str]]:
    """Return the times, NaN where there is none, and what of their unit is assumed.

    Dates are counted from the first one.
    """
    import pandas as pd

    given, name = cells.frame.iloc[:, column], cells.names[column]
    numbers = numeric(given)
    if not (pd.api.types.is_numeric_dtype(given) or np.isfinite(numbers).any()):
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
) -> tuple[dict[str, float], dict[str, str]]:
    """Return the factors of x and y, and what of their unit is assumed."""
    if wanted.unit is not None:
        return dict.fromkeys("xy", METRES[wanted.unit]), {}
    units = {axis: unit_of(cells.names[columns[axis]]) or "" for axis in "xy"}
    stated = [unit for unit in units.values() if unit in METRES]
    if len(stated) == 1:
        raise FileError(
            f"{where} must state the units of x and y or of none; write them behind the names, as"
            f" in x [m], or the unit of both into a --mapping file: {{unit: {stated[0]}}}"
        )
    scale = {axis: METRES.get(unit, 1.0) for axis, unit in units.items()}
    return scale, {} if stated else {"unit": "places in m"}


def _episodes(cells: Cells, columns: Columns, time_s: FloatArray) -> tuple[IntArray, list[str]]:
    """Return the number of the episode of each row, and their names, none where there is one.

    Without ids and a column of episodes, one begins where the time goes back near to the start of
    the one before.
    """
    if columns["episode"] >= 0:
        episode, labels = _numbered(cells.frame.iloc[:, columns["episode"]])
        return (episode, labels) if len(labels) > 1 else (0 * episode, [])
    back = np.diff(time_s, prepend=time_s[:1]) < 0
    begins = np.concatenate([[0], np.flatnonzero(back)])
    ends = np.concatenate([begins[1:], [len(time_s)]])
    elapsed = (time_s[ends - 1] - time_s[begins])[:-1]
    fallen = time_s[ends[:-1] - 1] - time_s[begins[1:]]
    if (
        columns["agent"] >= 0
        or len(time_s) < _FEWEST_ROWS * len(begins)
        or (fallen < _BACK * elapsed).any()
    ):
        return np.zeros(len(time_s), dtype=np.int64), []
    labels = [str(number) for number in range(1, len(begins) + 1)]
    return np.cumsum(back), labels if len(labels) > 1 else []


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
