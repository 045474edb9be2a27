"""The rows of a table: a place in metres at a time in seconds of an agent in an episode."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from serd_bag.errors import FileError
from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_files.trajectories.cells import Cells
from serd_files.trajectories.columns import (
    METRES,
    SECONDS,
    TableColumns,
    numeric,
    place_of,
    role_of,
    unit_of,
)
from serd_files.trajectories.places import ROBOT, Columns, Pair

if TYPE_CHECKING:
    import pandas as pd

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
    """Rows of all agents: row in the file, agent, episode, time_s (R,), place_m (R, 2).

    agent: -1 where it is unknown. names: of the agents, ids: theirs in the table, which may repeat
    in other episodes. has_ids: whether a column divides the rows into agents. assumed: what the
    table does not state, by the key of a mapping that states it.
    """

    row: IntArray
    agent: IntArray
    episode: IntArray
    time_s: FloatArray
    place_m: FloatArray
    names: list[str]
    ids: list[str]
    has_ids: bool
    assumed: dict[str, str]

    def select(self, kept: IntArray | BoolArray) -> "Rows":
        """Return some of the rows."""
        names = ("row", "agent", "episode", "time_s", "place_m")
        return replace(self, **{name: getattr(self, name)[kept] for name in names})

    @cached_property
    def good(self) -> BoolArray:
        """Whether a row has numbers and an agent."""
        return np.isfinite(self.time_s) & np.isfinite(self.place_m).all(axis=1) & (self.agent >= 0)

    @cached_property
    def by_agent(self) -> IntArray:
        """The good rows, sorted by agent and time."""
        good = np.flatnonzero(self.good)
        return good[np.lexsort((self.time_s[good], self.agent[good]))]


def rows_of(where: str, cells: Cells, columns: Columns, wanted: TableColumns) -> Rows:
    """Return the rows of all agents; raises FileError where a rate or a unit is not stated."""
    frame, pairs = cells.frame, columns.pairs
    time_s, of_time = _seconds(where, cells, columns.time, wanted)
    scale_of, of_place = _metres(where, cells, pairs, wanted)
    is_wide = pairs.keys() != {""}
    episode, labels = _episodes(cells, columns, time_s)
    rows, agents, places = [], [], []
    ids: list[str] = []
    for name, pair in sorted(pairs.items()):
        place = np.stack([scale_of[each] * numeric(frame.iloc[:, each]) for each in pair], axis=1)
        is_one = name == ROBOT or name[-1:].isdigit() or _is_robot(cells, pair)
        of_people = columns.agent >= 0 and not is_one
        numbers, texts = _ids(frame.iloc[:, columns.agent]) if of_people else _one(len(frame))
        there = np.isfinite(place).all(axis=1) if is_wide else np.ones(len(frame), dtype=bool)
        rows.append(np.flatnonzero(there))
        agents.append(np.where(numbers >= 0, numbers + len(ids), -1)[there])
        places.append(place[there])
        ids += [f"{name} {text}" if of_people and name else name or text for text in texts]
    row = np.concatenate(rows)
    table = Rows(
        row=row,
        agent=np.concatenate(agents),
        episode=episode[row],
        time_s=time_s[row],
        place_m=np.concatenate(places),
        names=ids,
        ids=ids,
        has_ids=is_wide or columns.agent >= 0,
        assumed=of_time | of_place,
    )
    word = cells.names[columns.episode] if columns.episode >= 0 else "episode"
    return _of_episodes(table, word, labels) if labels else table


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
            " second; write their rate into a --mapping file, as {fps: 25}"
        )
    size = np.nanmedian(np.abs(numbers)) if np.isfinite(numbers).any() else 0.0
    unix = next((unit for least, unit in _SINCE_1970 if size > least), None)
    return numbers * SECONDS[unix or "s"], {} if unix else {"time_unit": "times in s"}


def _metres(
    where: str, cells: Cells, pairs: Mapping[str, Pair], wanted: TableColumns
) -> tuple[dict[int, float], dict[str, str]]:
    """Return a factor for each column of places, and what of their unit is assumed."""
    columns = [column for pair in pairs.values() for column in pair]
    if wanted.unit is not None:
        return dict.fromkeys(columns, METRES[wanted.unit]), {}
    units = {column: unit_of(cells.names[column]) for column in columns}
    silent = [cells.names[column] for column, unit in units.items() if unit not in METRES]
    stated = sorted({unit for unit in units.values() if unit in METRES})
    if silent and stated:
        raise FileError(
            f"{where} must state the units of all places or of none, those of {', '.join(silent)}"
            " are not stated; write them behind the names, as in x [m], or the unit of all into a"
            f" --mapping file: {{unit: {stated[0]}}}"
        )
    scale_of = {column: METRES.get(unit or "m", 1.0) for column, unit in units.items()}
    return scale_of, {"unit": "places in m"} if silent else {}


def _episodes(cells: Cells, columns: Columns, time_s: FloatArray) -> tuple[IntArray, list[str]]:
    """Return the number of the episode of each row, and their names, none where there is one."""
    import pandas as pd

    if columns.episode >= 0:
        numbers, names = pd.factorize(cells.frame.iloc[:, columns.episode], sort=True)
        labels = [_text(name) for name in names]
    else:
        numbers = restarts(time_s) if columns.agent < 0 else np.zeros(len(time_s))
        labels = [str(number + 1) for number in range(int(numbers.max(initial=0)) + 1)]
    episode = numbers.astype(np.int64)
    return (episode, labels) if len(labels) > 1 else (0 * episode, [])


def _of_episodes(rows: Rows, word: str, labels: list[str]) -> Rows:
    """Return the rows with another agent in each episode, named after agent and episode."""
    known = (rows.agent >= 0) & (rows.episode >= 0)
    pairs = np.stack([rows.agent[known], rows.episode[known]], axis=1)
    keys, numbers = np.unique(pairs, axis=0, return_inverse=True)
    agent = np.full(len(rows.agent), -1, dtype=np.int64)
    agent[known] = numbers.ravel()
    ids = [rows.ids[key] for key in keys[:, 0]]
    of_episode = [labels[key] for key in keys[:, 1]]
    names = of_episode
    if rows.has_ids:
        names = [f"{name} of {word} {label}" for name, label in zip(ids, of_episode, strict=True)]
    return replace(rows, agent=agent, names=names, ids=ids)


def _is_robot(cells: Cells, pair: Pair) -> bool:
    place = place_of(cells.names[pair.x])
    return place is not None and place.kind == "robot"


def _one(count: int) -> tuple[IntArray, list[str]]:
    return np.zeros(count, dtype=np.int64), ["0"]


def _ids(column: "pd.Series[Any]") -> tuple[IntArray, list[str]]:
    """Return the number of the agent of each row, -1 where there is none, and their names."""
    import pandas as pd

    numbers, names = pd.factorize(column, sort=True)
    return numbers.astype(np.int64), [_text(name) for name in names]


def _text(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def restarts(time: FloatArray) -> IntArray:
    """(R,) number of the episode of each row without ids, counted where the time (R,) goes back.

    All 0 where it never goes back near to the start of the episode before.
    """
    episode = np.zeros(len(time), dtype=np.int64)
    back = np.flatnonzero(np.diff(time) < 0) + 1
    if not len(back) or len(time) < _FEWEST_ROWS * (len(back) + 1):
        return episode
    begins = np.concatenate([[0], back])
    elapsed = time[back - 1] - time[begins[:-1]]
    if (time[back - 1] - time[back] < _BACK * elapsed).any():
        return episode
    episode[back] = 1
    return np.cumsum(episode)


def on_one_clock(time_s: FloatArray, episode: IntArray) -> tuple[FloatArray, tuple[str, ...]]:
    """(N,) times without overlaps of the episodes (N,), and a sentence where there were some."""
    if not episode.any():
        return time_s, ()
    count = int(episode.max()) + 1
    begin_s, end_s = np.full(count, np.inf), np.full(count, -np.inf)
    np.minimum.at(begin_s, episode, time_s)
    np.maximum.at(end_s, episode, time_s)
    there = np.flatnonzero(np.isfinite(begin_s))
    order = there[np.argsort(begin_s[there], kind="stable")]
    if (begin_s[order[1:]] > end_s[order[:-1]]).all():
        return time_s, ()
    shift_s = np.zeros(count)
    last_s = np.cumsum(end_s[there] - begin_s[there] + _APART_S)
    shift_s[there] = np.concatenate([[0.0], last_s[:-1]]) - begin_s[there] + begin_s[there[0]]
    sentence = f"times of {len(there)} episodes overlap, so each has a clock of its own"
    return time_s + shift_s[episode], (sentence,)
