"""Which columns of a table hold the time, the ids, and the places of which agent.

The names are a closed set, which docs/sources.md lists; all else is stated by a mapping. Where it
is not certain whose the places in columns are, an error shows the mapping to write.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
import yaml

from serd_bag.errors import FileError
from serd_core.arrays import FloatArray
from serd_files.settings import setting
from serd_files.yaml_config import StrictModel

if TYPE_CHECKING:
    import pandas as pd

    from serd_files.trajectories.cells import Cells

METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001}
ROBOT, PERSON = "robot", "person"
_NAMES = {
    "time": ("time", "timestamp", "stamp", "t"),
    "frame": ("frame", "frame_id", "fr"),
    "agent": ("id", "agent", "agent_id", "person", "person_id", "ped", "ped_id", "pedestrian",
              "pedestrian_id", "track", "track_id"),
    "episode": ("episode", "episode_id", "run", "run_id", "trial", "trial_id", "scene", "scene_id"),
}  # fmt: skip
_ROLE_OF = {name: role for role, names in _NAMES.items() for name in names}
_UNIT = re.compile(r"(?:[\s_/]+|\s*[\[(]\s*)(m|cm|mm|s|ms|us|ns)\s*[\])]?\s*$")
_WORD = re.compile(r"[^\W\d_]+|\d+")
_AXES = frozenset(["x", "y", "px", "py", "tx", "ty"])
#: Words for a place, which may precede or follow the axis.
_PLACE = frozenset(["position", "pos", "pose", "field"])
_KIND_OF = {
    **dict.fromkeys(["robot", "agv", "amr", "ego"], ROBOT),
    **dict.fromkeys(["person", "people", "ped", "pedestrian", "human"], PERSON),
}


class TableColumns(StrictModel):
    """Names of the columns, or their numbers from 1; empty: found by their names."""

    time: str = setting("", "column of times or frames: its name, or its number from 1")
    agent: str = setting("", "column of ids")
    episode: str = setting("", "column of episodes, in each of which ids and times may begin again")
    x: str = setting("", "column of x; where people have columns of their own, that of the robot")
    y: str = setting("", "column of y, likewise")
    fps: float | None = setting(
        None, "frames per second, where the column of times holds frames", unit="Hz", gt=0
    )
    time_unit: Literal["s", "ms", "us", "ns"] | None = setting(
        None, "unit of times; by default that of the name, else s"
    )
    unit: Literal["m", "cm", "mm"] | None = setting(
        None, "unit of x and y; by default that of their names, else m"
    )

    def completed(self, stated: Mapping[str, Any]) -> "TableColumns":
        """Return the mapping with what the layout states, where the mapping states nothing.

        A unit of times that the layout states gives way to a rate in the mapping.
        """
        known = {"time_unit"} if self.fps is not None else set()
        known |= {key for key in stated if getattr(self, key) not in (None, "")}
        return self.model_copy(update={key: stated[key] for key in stated.keys() - known})


class Pair(NamedTuple):
    """The columns of x and y of one agent."""

    x: int
    y: int


class Place(NamedTuple):
    """What the name of a column of places states.

    agent: the other words of the name, empty for x and y alone. kind: own (x and y alone), robot,
    person, numbered (`x1`) or unknown (`spot_x`). form: the name without its axis, which x and y of
    one source have in common.
    """

    agent: str
    kind: str
    axis: str
    form: tuple[str, ...]


@dataclass(frozen=True)
class Columns:
    """Numbers of columns, -1 for ids and episodes where the table has none.

    pairs: by agent; the key is empty where one pair holds the places of all agents.
    """

    time: int
    agent: int
    episode: int
    pairs: Mapping[str, Pair]


def role_of(name: str) -> str | None:
    """Return what the name of a column stands for: frame, time, agent, episode, x or y."""
    role = _ROLE_OF.get("_".join(_words(name)))
    place = None if role else place_of(name)
    return place.axis if place and place.kind == "own" else role


def place_of(name: str) -> Place | None:
    """Return the agent and the axis that a name states, or None for names of other columns.

    >>> place_of("robot_pose_x").agent, place_of("y [cm]").axis, place_of("yaw")
    ('robot', 'y', None)
    """
    words = _words(name)
    axes = [at for at, word in enumerate(words) if word in _AXES]
    if len(axes) != 1:
        return None
    (at,) = axes
    rest = [word for word in words if word not in _AXES | _PLACE]
    letters = "".join(word for word in rest if not word.isdecimal())
    kind = _KIND_OF.get(letters, "unknown") if letters else "numbered" if rest else "own"
    form = (*words[:at], words[at][:-1], *words[at + 1 :], unit_of(name) or "")
    return Place("".join(rest), kind, words[at][-1], form)


def _words(name: str) -> list[str]:
    """Return the words and numbers of a name without its unit."""
    return _WORD.findall(_UNIT.sub("", name.strip()).lower())


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

    >>> mapping_of(["t", "robot_x", "robot_y"], x=1, y=2)
    '{x: robot_x, y: robot_y}'

    Columns of equal names are named by their numbers.
    """
    chosen = {
        key: names[column] if list(names).count(names[column]) == 1 else str(column + 1)
        for key, column in columns.items()
    }
    text = yaml.safe_dump(chosen, default_flow_style=True, width=10_000, allow_unicode=True)
    return str(text).strip()


def columns_of(where: str, cells: "Cells", wanted: TableColumns) -> Columns:
    """Return the columns of a table; raises FileError where they are missing or not certain."""
    names = cells.names
    given = {
        role: _column_named(where, names, text, role)
        for role in ("time", "agent", "episode", "x", "y")
        if (text := getattr(wanted, role))
    }
    by_name = {role: at for at, name in reversed(list(enumerate(names))) if (role := role_of(name))}
    found = by_name | given
    if "time" not in given:
        _require_one_time(where, cells)
        found.setdefault("time", found.get("frame", -1))
    if {"x", "y"} <= given.keys():
        pairs = _beside(where, names, Pair(given["x"], given["y"]))
    elif "x" in given or "y" in given:
        pairs = {"": Pair(found["x"], found["y"])} if {"x", "y"} <= found.keys() else {}
    else:
        pairs = _by_name(where, cells, has_ids="agent" in found)
    if found["time"] < 0 or not pairs:
        raise _missing(where, names, found, has_pairs=bool(pairs))
    return Columns(found["time"], found.get("agent", -1), found.get("episode", -1), pairs)


def _column_named(where: str, names: Sequence[str], text: str, role: str) -> int:
    """Return the column that a mapping names for a role."""
    if text in names:
        return list(names).index(text)
    if text.isdecimal() and 1 <= int(text) <= len(names):
        return int(text) - 1
    raise FileError(
        f"{where}: {role} must be one of the columns {', '.join(names)}, got {text!r}; correct the"
        " mapping"
    )


def _require_one_time(where: str, cells: "Cells") -> None:
    """Raise FileError with the mappings to write if several columns hold times."""
    names = cells.names
    times = [column for column, name in enumerate(names) if role_of(name) == "time"]
    clocks = [at for at in times if np.isfinite(numeric(cells.frame.iloc[:, at])).any()]
    if len(clocks) > 1:
        mappings = " or ".join(mapping_of(names, time=column) for column in clocks)
        raise FileError(
            f"{where} must have one column of times, it has"
            f" {' and '.join(names[column] for column in clocks)}; write one of them into a"
            f" --mapping file: {mappings}"
        )


def _named_pairs(names: Sequence[str]) -> list[tuple[Place, Pair]]:
    """Return the pairs of columns whose names differ by the axis alone; of names that are there
    twice the first with the first."""
    columns: dict[Place, dict[str, list[int]]] = {}
    for column, name in enumerate(names):
        if place := place_of(name):
            axes = columns.setdefault(place._replace(axis=""), {"x": [], "y": []})
            axes[place.axis].append(column)
    return [
        (place, Pair(*pair))
        for place, axes in columns.items()
        for pair in zip(axes["x"], axes["y"], strict=False)
    ]


def _of_kind(where: str, names: Sequence[str], *kinds: str, but: Pair | None) -> dict[str, Pair]:
    """Return the pair of each agent of these kinds; raises FileError for an agent with two."""
    by_agent: dict[str, list[Pair]] = {}
    for place, pair in _named_pairs(names):
        if place.kind in kinds and pair != but:
            by_agent.setdefault(place.agent, []).append(pair)
    for pairs in by_agent.values():
        _require_one(where, names, pairs)
    return {agent: pairs[0] for agent, pairs in by_agent.items()}


def _by_name(where: str, cells: "Cells", *, has_ids: bool) -> dict[str, Pair]:
    """Return the columns of each agent by their names, none where there are none.

    x and y are a person's beside columns of a robot, and the robot's beside columns of people.
    """
    names = cells.names
    own, robots, people, numbered = (
        _of_kind(where, names, kind, but=None) for kind in ("own", ROBOT, PERSON, "numbered")
    )
    if robots or (own and not has_ids):  # beside a column of ids, numbers behind x are none
        people |= {f"{PERSON} {number}": pair for number, pair in numbered.items()}
    if robots:
        kinds = {re.sub(r"[\W_\d]+$", "", name): name for name in robots}
        _require_one(where, names, [robots[name] for name in kinds.values()])
        is_person = own and not _are_same(cells, own[""], next(iter(robots.values())))
        return robots | people | ({PERSON: own[""]} if is_person else {})
    if own:
        return {ROBOT: own[""], **people} if people else own
    if people:
        unknown = [pair for place, pair in _named_pairs(names) if place.kind == "unknown"]
        _require_one(where, names, [*list(people.values())[:1], *unknown])
    return people


def _beside(where: str, names: Sequence[str], chosen: Pair) -> dict[str, Pair]:
    """Return the columns that a mapping names, and those of people beside them.

    Columns of x and y alone, and of numbered ones, are of people if the robot's have its name.
    """
    places = [place_of(names[column]) for column in chosen]
    has_name = all(place is not None and place.kind == ROBOT for place in places)
    kinds = (PERSON, "own", "numbered") if has_name else (PERSON,)
    people = _of_kind(where, names, *kinds, but=chosen)
    people = {agent or PERSON: pair for agent, pair in people.items()}
    return {ROBOT: chosen, **people} if people else {"": chosen}


def _require_one(where: str, names: Sequence[str], pairs: Sequence[Pair]) -> None:
    """Raise FileError with the mappings to write if there are several pairs."""
    if len(pairs) == 1:
        return
    listed = " and ".join(f"{names[pair.x]}, {names[pair.y]}" for pair in pairs)
    mappings = " or ".join(mapping_of(names, **pair._asdict()) for pair in pairs)
    raise FileError(
        f"{where} must have one pair of columns for the robot, or for x and y, it has {listed};"
        f" write one of them into a --mapping file: {mappings}"
    )


def _are_same(cells: "Cells", one: Pair, other: Pair) -> bool:
    """Whether two pairs of columns hold the same numbers."""
    a, b = ([numeric(cells.frame.iloc[:, column]) for column in pair] for pair in (one, other))
    return np.allclose(a, b, equal_nan=True)


def _missing(
    where: str, names: Sequence[str], found: Mapping[str, int], *, has_pairs: bool
) -> FileError:
    """Return the error about columns that are missing, with a mapping in the order of the table."""
    pairs = [] if has_pairs else [pair for _, pair in _named_pairs(names)]
    needed = ["time"] if found["time"] < 0 else []
    lacking = needed if has_pairs else [*needed, "x", "y"]
    sentence = (
        f"{where} must have columns of time, x and y, {' and '.join(lacking)}"
        f" {'is' if len(lacking) == 1 else 'are'} not among {', '.join(names)}"
    )
    taken, chosen = set(found.values()), dict[str, int]()
    if has_pairs or pairs:
        taken |= {column for column, name in enumerate(names) if place_of(name)}
        chosen = pairs[0]._asdict() if pairs else {}
    else:
        needed = lacking
    rest = [column for column in range(len(names)) if column not in taken]
    if len(rest) < len(needed):
        return FileError(f"{sentence}; export the table with them")
    if len(rest) > len(needed) > 1 and "agent" not in found:
        needed = [*needed[:-2], "agent", "x", "y"]
    rest.sort(key=lambda column: "time" not in names[column].lower())
    mapping = mapping_of(names, **dict(zip(needed, rest, strict=False)), **chosen)
    return FileError(f"{sentence}; name the columns in a --mapping file, as {mapping}")
