"""Which columns of a table hold the time, the ids, x and y; and its rows: a place in metres at a
time in seconds of an agent in an episode.

The names are a closed set, which docs/sources.md lists; all else is stated by a mapping.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import yaml
from pydantic import field_validator

from serd_bag.errors import FileError
from serd_core.arrays import FloatArray, IntArray
from serd_files.settings import setting
from serd_files.yaml_config import StrictModel

if TYPE_CHECKING:
    import pandas as pd

METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001}
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
#: Least sizes of times since 1970 in ms, us and ns; in s they are below all of them.
_SINCE_1970 = ((1e17, "ns"), (1e14, "us"), (1e11, "ms"))
#: Fewest rows per episode.
_FEWEST_ROWS = 5
#: Smallest share of an episode by which time goes back where the next one begins.
_BACK = 0.5
_NAMES = {
    "time": ("time", "timestamp", "stamp", "t"),
    "frame": ("frame", "frame_id", "fr"),
    "agent": ("id", "agent", "agent_id", "person", "person_id", "ped", "ped_id", "pedestrian",
              "pedestrian_id", "track", "track_id", "human", "human_id"),
    "episode": ("episode", "episode_id", "run", "run_id", "trial", "trial_id", "scene", "scene_id"),
    "x": ("x", "px", "tx"),
    "y": ("y", "py", "ty"),
}  # fmt: skip
_ROLE_OF = {name: role for role, names in _NAMES.items() for name in names}
#: Columns by their roles; -1 where the table has none.
Columns = dict[str, int]
_UNIT = re.compile(r"(?:[\s_/]+|\s*[\[(]\s*)(m|cm|mm|s|ms|us|ns)\s*[\])]?\s*$")
_WORD = re.compile(r"[^\W\d_]+|\d+")
_CASE = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")
#: Words of degrees, and the largest ones.
_DEGREES = {
    "north": (frozenset(["lat", "latitude"]), 90.0),
    "east": (frozenset(["lon", "lng", "long", "longitude"]), 180.0),
}
#: Words for a place, which may precede the axis.
PLACE_WORDS = frozenset(["position", "pos", "pose", "field"])


@dataclass(frozen=True, eq=False)
class Cells:
    """names: of all columns; stated: what the layout states, by the key of a mapping."""

    frame: "pd.DataFrame"
    names: tuple[str, ...]
    stated: dict[str, Any] = field(default_factory=dict)


class TableColumns(StrictModel):
    """Names of the columns, or their numbers from 1; empty: found by their names."""

    time: str = setting("", "column of times or frames: its name, or its number from 1")
    agent: str = setting("", "column of ids")
    episode: str = setting("", "column of episodes, in each of which ids and times may begin again")
    x: str = setting("", "column of x")
    y: str = setting("", "column of y")
    robot_columns: tuple[str, ...] = setting(
        (), "columns of x and y of the robot, where agents have columns of their own", max_length=2
    )
    people_columns: tuple[tuple[str, str], ...] = setting(
        (), "columns of x and y of each person, where people have columns of their own"
    )
    fps: float | None = setting(
        None, "frames per second, where the column of times holds frames", unit="Hz", gt=0
    )
    time_unit: Literal["s", "ms", "us", "ns"] | None = setting(
        None, "unit of times; by default that of the name, else s"
    )
    unit: Literal["m", "cm", "mm"] | None = setting(
        None, "unit of x and y; by default that of their names, else m"
    )

    fastest_mps: float = setting(
        1.7,
        "mean speed of moving agents above which a table is rejected, as its rate or unit is wrong",
        unit="m/s",
        gt=0,
    )

    @field_validator("robot_columns")
    @classmethod
    def _is_a_pair(cls, columns: tuple[str, ...]) -> tuple[str, ...]:
        if len(columns) == 1:
            raise ValueError("must name the columns of x and y, got one; add the other")
        return columns

    def completed(self, stated: Mapping[str, Any]) -> "TableColumns":
        """Return the mapping with what the layout states, where the mapping states nothing.

        A unit of times that the layout states gives way to a rate in the mapping.
        """
        known = {"time_unit"} if self.fps is not None else set()
        known |= {key for key in stated if getattr(self, key) not in (None, "")}
        return self.model_copy(update={key: stated[key] for key in stated.keys() - known})


def role_of(name: str) -> str | None:
    """Return what the name of a column stands for: frame, time, agent, episode, x or y.

    >>> role_of("pose.position.x"), role_of("Track_ID"), role_of("y [cm]"), role_of("yaw")
    ('x', 'agent', 'y', None)
    """
    words = _WORD.findall(_UNIT.sub("", name.strip()).lower())
    return _ROLE_OF.get("_".join(word for word in words if word not in PLACE_WORDS))


def words_of(name: str) -> list[str]:
    """Return the words of a name without its unit, in lower case; numbers are words.

    >>> words_of("robotPose.x [m]"), words_of("x12")
    (['robot', 'pose', 'x'], ['x', '12'])
    """
    return [word.lower() for word in _WORD.findall(_CASE.sub("_", _UNIT.sub("", name.strip())))]


def unit_of(name: str) -> str | None:
    """Return the unit at the end of a name, or None if it states none.

    >>> unit_of("x/cm"), unit_of("t [ms]"), unit_of("x")
    ('cm', 'ms', None)
    """
    found = _UNIT.search(name.strip().lower())
    return found[1] if found else None


def numeric(column: "pd.Series[Any]") -> FloatArray:
    """Return the numbers of a column, NaN for what is none or above 1e20, as no stamp in ns is."""
    import pandas as pd

    try:
        numbers = pd.to_numeric(column, errors="coerce")
    except OverflowError:  # an integer of more than 308 digits
        short = column.where(column.astype(str).str.len() < 300)
        numbers = pd.to_numeric(short, errors="coerce")
    values: FloatArray = numbers.to_numpy(dtype=np.float64, na_value=np.nan)
    return np.where(np.abs(values) <= 1e20, values, np.nan)


def mapping_of(names: Sequence[str], **columns: int) -> str:
    """Return what a mapping file must hold to name these columns.

    >>> mapping_of(["t", "east", "north"], x=1, y=2)
    '{x: east, y: north}'

    Columns of equal names are named by their numbers.
    """
    chosen = {
        key: names[column] if list(names).count(names[column]) == 1 else str(column + 1)
        for key, column in columns.items()
    }
    return flow_style(chosen)


def flow_style(values: Mapping[str, Any]) -> str:
    """Return the values as YAML in one line."""
    text = yaml.safe_dump(
        dict(values), default_flow_style=True, width=10_000, allow_unicode=True, sort_keys=False
    )
    return str(text).strip()


def columns_of(where: str, cells: Cells, wanted: TableColumns) -> Columns:
    """Return the columns of a table; raises FileError where they are missing or not certain."""
    names = cells.names
    given = {
        role: column_named(where, names, text, role)
        for role in ("time", "agent", "episode", "x", "y")
        if (text := getattr(wanted, role))
    }
    _require_one(where, cells, [role for role in ("time", "x", "y") if role not in given])
    by_name = {role: at for at, name in reversed(list(enumerate(names))) if (role := role_of(name))}
    found = {"agent": -1, "episode": -1} | by_name | given
    if "time" not in found and "frame" in found:
        found["time"] = found["frame"]
    if not found.keys() >= {"time", "x", "y"}:
        raise _missing(where, cells, found)
    return found


def column_named(where: str, names: Sequence[str], text: str, role: str) -> int:
    """Return the column that a mapping names for a role."""
    if text in names:
        return list(names).index(text)
    if text.isdecimal() and 1 <= int(text) <= len(names):
        return int(text) - 1
    raise FileError(
        f"{where}: {role} must be one of the columns {', '.join(names)}, got {text!r}; correct the"
        " mapping"
    )


def _require_one(where: str, cells: Cells, roles: Sequence[str]) -> None:
    """Raise FileError with the mappings to write if several columns have one of the roles and
    numbers; each mapping names a column for all such roles."""
    names, several = cells.names, {}
    for role in roles:
        found = [column for column, name in enumerate(names) if role_of(name) == role]
        found = [at for at in found if has_numbers(cells, at)]
        if len(found) > 1:
            several[role] = found
    if not several:
        return
    role, found = next(iter(several.items()))
    choices = (
        {each: columns[min(at, len(columns) - 1)] for each, columns in several.items()}
        for at in range(max(map(len, several.values())))
    )
    mappings = " or ".join(mapping_of(names, **choice) for choice in choices)
    raise FileError(
        f"{where} must have one column of {'times' if role == 'time' else role}, it has"
        f" {' and '.join(names[column] for column in found)}; write one of them into a"
        f" --mapping file: {mappings}"
    )


def _degrees(cells: Cells) -> list[str]:
    """Return the names of the columns of latitudes and longitudes, empty without one of each."""
    found: dict[str, str] = {}
    for at, name in enumerate(cells.names):
        largest = np.nanmax(np.abs(numeric(cells.frame.iloc[:, at])), initial=0.0)
        for key, (words, most) in _DEGREES.items():
            if words.intersection(words_of(name)) and largest <= most:
                found.setdefault(key, name)
    return list(found.values()) if len(found) == len(_DEGREES) else []


def _is_constant(column: "pd.Series[Any]") -> bool:
    return len(column) > 1 and column.nunique() <= 1


def has_numbers(cells: Cells, at: int) -> bool:
    """Return whether a column has a number."""
    return bool(np.isfinite(numeric(cells.frame.iloc[:, at])).any())


def _repeats(cells: Cells, at: int) -> bool:
    """Whether a column has the same values again and again, as one of ids."""
    return bool(2 * cells.frame.iloc[:, at].nunique() <= len(cells.frame))


def _missing(where: str, cells: Cells, found: Mapping[str, int]) -> FileError:
    """Return the error about columns that are missing, with a mapping in the order of the table.

    Columns with one number alone are no places or times, and degrees are none either.
    """
    names = cells.names
    lacking = [role for role in ("time", "x", "y") if role not in found]
    sentence = (
        f"{where} must have columns of time, x and y, {' and '.join(lacking)}"
        f" {'is' if len(lacking) == 1 else 'are'} not among {', '.join(names)}"
    )
    if degrees := _degrees(cells):
        return FileError(
            f"{sentence}; {' and '.join(degrees)} are degrees, convert them to metres (UTM, or east"
            " and north of a point) in columns x and y"
        )
    words = {
        at: _WORD.findall(name.lower())
        for at, name in enumerate(names)
        if at not in found.values() and not _is_constant(cells.frame.iloc[:, at])
    }
    if len(words) < len(lacking):
        return FileError(f"{sentence}; export the table with them")
    if (
        len(words) > len(lacking) > 1
        and found["agent"] < 0
        and not any("x" in each for each in words.values())
        and _repeats(cells, list(words)[len(lacking) - 2])
    ):
        lacking = [*lacking[:-2], "agent", "x", "y"]
    chosen = {}
    for role in lacking:
        fitting = [at for at in words if role == "agent" or has_numbers(cells, at)]
        if not fitting:
            return FileError(f"{sentence}; export the table with them")
        chosen[role] = next((at for at in fitting if role in words[at]), fitting[0])
        del words[chosen[role]]
    mapping = mapping_of(names, **chosen)
    return FileError(f"{sentence}; name the columns in a --mapping file, as {mapping}")


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
    rows = pd.DataFrame({"row": frame.index.to_numpy(), **numbers})
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
