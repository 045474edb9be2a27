"""Agents with columns of their own: a robot in `robot_x, robot_y`, people in `x1, y1, x2, y2, ...`
or in rows of `x, y` and an id.

A pair of coordinates is two names that differ in the word of the axis alone, or in one letter of a
word that begins or ends with it. The name of a pair is what is left of them: `robot` of robot_x or
robotx, `1` of x1, nothing of x. One pair is taken as the robot if
its name has that word and no other pair competes; otherwise the mapping must name it.
"""

import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

from serd_bag.errors import FileError
from serd_files.trajectories.columns import (
    PLACE_WORDS,
    Cells,
    TableColumns,
    column_named,
    columns_of,
    flow_style,
    has_numbers,
    mapping_of,
    role_of,
    rows_of,
    unit_of,
    words_of,
)
from serd_files.yaml_config import yaml_model

_AXIS = {"x": "x", "px": "x", "tx": "x", "y": "y", "py": "y", "ty": "y"}
_ROBOT = re.compile(r"(robots?[a-z]?|agv|amr|ego)$")
_PERSON = frozenset(
    ["person", "persons", "people", "ped", "peds", "pedestrian", "human", "agent", "p", "h", "id"]
)
#: Words of pairs that are no place of an agent: quantities of another kind, and places to be.
_NO_PLACE = frozenset(
    (
        *("v", "vel", "velocity", "speed", "twist", "linear", "angular", "acc", "acceleration"),
        *("force", "orientation", "quaternion", "cov", "covariance", "size", "width", "heading"),
    )
)
_WANTED = frozenset(
    ["goal", "target", "waypoint", "final", "destination", "plan", "path", "desired", "cmd"]
)
#: Name of the column of ids of people in rows that repeat the robot.
_COLUMN = "column"
#: Letters that may stand for an agent where the axis is written to them: rx, xh.
_LETTERS = frozenset("rph")
#: Share of rows that may repeat an id at a time, and fewest rows of an id in the mean.
_REPEATED, _FEWEST_ROWS = 0.01, 2


class Pair(NamedTuple):
    """The columns of x and y of one agent, and the name of the pair."""

    name: str
    x: int
    y: int

    @property
    def words(self) -> set[str]:
        """Words of the name."""
        return set(self.name.split())

    @property
    def is_robot(self) -> bool:
        """Whether the name is one of a robot's place."""
        return any(map(_ROBOT.match, self.words)) and not self.words & _WANTED

    @property
    def is_person(self) -> bool:
        """Whether the name is a number or one of a person."""
        words = self.words
        return bool(words & _PERSON) or (bool(words) and all(map(str.isdecimal, words)))


def pairs_of(names: Sequence[str]) -> list[Pair]:
    """Return the pairs of coordinates in the order of the columns; a name of two pairs is none's.

    >>> [pair.name for pair in pairs_of(["t", "robot_x", "robot_y", "x1", "y1", "vel_x", "vel_y"])]
    ['robot', '1']
    """
    found: dict[tuple[str, ...], dict[str, list[int]]] = {}
    for column, name in enumerate(names):
        words = words_of(name)
        axes = [_AXIS[word] for word in words if word in _AXIS]
        each = [(axes[0], [word for word in words if word not in _AXIS])] if len(axes) == 1 else []
        for axis, parts in each or ([] if axes else _joined(words)):
            rest = tuple(word for word in parts if word not in PLACE_WORDS)
            if not _NO_PLACE.intersection(rest):
                found.setdefault(rest, {"x": [], "y": []})[axis].append(column)
    return [
        Pair(" ".join(rest), *axes["x"], *axes["y"])
        for rest, axes in found.items()
        if len(axes["x"]) == len(axes["y"]) == 1
    ]


def _joined(words: Sequence[str]) -> Iterator[tuple[str, list[str]]]:
    """Yield axis and other words of a name in which the axis begins or ends a word."""
    for at, word in enumerate(words):
        for axis, rest in ((word[-1:], word[:-1]), (word[:1], word[1:])):
            if axis in ("x", "y") and (len(rest) > 1 or rest in _LETTERS):
                yield axis, [*words[:at], rest, *words[at + 1 :]]


def in_rows(where: str, cells: Cells, wanted: TableColumns) -> tuple[Cells, TableColumns, str]:
    """Return the cells with a row per agent and time, the mapping of their columns, and a sentence
    about coordinates that are not used, empty without some.

    Tables that have a row per agent already are returned as they are. FileError with the mappings
    to write where the columns of the robot are not certain.
    """
    pairs = [
        pair
        for pair in pairs_of(cells.names)
        if has_numbers(cells, pair.x) and has_numbers(cells, pair.y)
    ]
    if wanted.robot_columns or wanted.people_columns:
        robot, people, rows = _stated(where, cells.names, wanted)
    elif wanted.x or wanted.y:
        used = {_named(cells.names, text) for text in (wanted.x, wanted.y)}
        return cells, wanted, _unused(cells.names, pairs, used)
    else:
        robot, people, rows = _by_name(where, cells, wanted, pairs)
    if robot is None and not people:
        used = {rows.x, rows.y} if rows else set()
        return cells, wanted, _unused(cells.names, pairs, used) if rows else ""
    chosen = [pair for pair in (robot, *people, rows) if pair is not None]
    used = {column for pair in chosen for column in (pair.x, pair.y)}
    long, mapping = _long(where, cells, wanted, robot, people, rows)
    return long, mapping, _unused(cells.names, pairs, used)


def _named(names: Sequence[str], text: str) -> int:
    return list(names).index(text) if text in names else int(text) - 1 if text.isdecimal() else -1


_Choice = tuple[Pair | None, list[Pair], Pair | None]


def _stated(where: str, names: Sequence[str], wanted: TableColumns) -> _Choice:
    """Return the robot, the people and x, y of rows that a mapping names."""

    def pair(name: str, texts: Sequence[str], key: str) -> Pair:
        return Pair(name, *(column_named(where, names, text, key) for text in texts))

    by_columns = {(each.x, each.y): each.name for each in pairs_of(names)}
    people = [pair("", texts, "people_columns") for texts in wanted.people_columns]
    named = [by_columns.get((each.x, each.y), str(at)) for at, each in enumerate(people, start=1)]
    people = [each._replace(name=name) for each, name in zip(people, named, strict=True)]
    robot = pair("robot", wanted.robot_columns, "robot_columns") if wanted.robot_columns else None
    rows = pair("", (wanted.x, wanted.y), "x and y") if wanted.x and wanted.y else None
    return robot, people, rows


def _by_name(where: str, cells: Cells, wanted: TableColumns, pairs: Sequence[Pair]) -> _Choice:
    """Return the robot, the people and x, y of rows by the names of the columns."""
    names = cells.names
    robots = [pair for pair in pairs if pair.is_robot]
    rows = next((pair for pair in pairs if not pair.name), None)
    people = [pair for pair in pairs if pair.is_person and not pair.is_robot]
    rivals = [pair for pair in pairs if pair.name and not pair.words & _WANTED]
    ids = _ids(names, wanted)
    by_row = [pair for pair in people if ids and pair.words <= set(words_of(ids))]
    if rows is None and len(by_row) == 1:  # person_id, person_x, person_y
        rows = by_row[0]
        people, rivals = [], [pair for pair in rivals if pair != rows]
    if len(robots) == 1 and (rows is None or ids):
        # With ids in rows, further pairs of people are named, as the rows have them already.
        return robots[0], [] if rows else people, rows
    if not robots and rows and (ids or not rivals):
        return None, [], rows
    if not robots and rows is None and not pairs:
        return None, [], None
    if not robots and rows is None and len(pairs) == 1 and not pairs[0].words & _WANTED:
        return None, [], None  # the error about missing columns shows its mapping
    raise _uncertain(where, cells, pairs, robots)


def _ids(names: Sequence[str], wanted: TableColumns) -> str:
    """Return the column of ids of a table whose rows are agents, empty without one."""
    if wanted.agent:
        return wanted.agent
    return next((name for name in names if role_of(name) == "agent" or name == _COLUMN), "")


def _uncertain(
    where: str, cells: Cells, pairs: Sequence[Pair], robots: Sequence[Pair]
) -> FileError:
    """Return the error about two robots or none, with the mappings that work."""
    names = cells.names
    places = [pair for pair in pairs if not pair.words & _WANTED]
    people = [pair for pair in places if pair.is_person and not pair.is_robot]
    candidates: list[Pair] = [pair for pair in robots or places if pair not in people]
    candidates += [pair for pair in places if not pair.name and pair not in candidates]
    chosen: list[Pair | None] = [*candidates] or [None]
    mappings = []
    if len(robots) == 1:  # the others may be people by row
        mappings = [mapping_of(names, agent=column) for column in id_columns(cells)]
    mappings += [_mapping(names, pairs, candidate, people) for candidate in chosen]
    listed = " and ".join(f"{names[each.x]}, {names[each.y]}" for each in places)
    shown = [text for text in mappings if _works(where, cells, text)]
    fix = f"name them in a --mapping file: {' or '.join(shown)}"
    if not shown:
        fix = "put each agent into rows of its own, with an id"
    return FileError(
        f"{where} must have one pair of columns that is named as the place of a robot, it has"
        f" {len(robots) or 'none'} among {listed}; {fix}"
    )


def _mapping(
    names: Sequence[str], pairs: Sequence[Pair], robot: Pair | None, people: Sequence[Pair]
) -> str:
    chosen: dict[str, Any] = {}
    roles = [role_of(name) for name in names]
    if "time" in roles and roles.count("time") > 1:
        chosen["time"] = names[roles.index("time")]
    if not {"time", "frame"} & set(roles):
        used = {column for pair in pairs for column in (pair.x, pair.y)}
        chosen["time"] = next((name for at, name in enumerate(names) if at not in used), names[0])
    if robot is not None:
        chosen["robot_columns"] = _texts(names, robot)
    if people:
        chosen["people_columns"] = [_texts(names, each) for each in people]
    return flow_style(chosen)


def _works(where: str, cells: Cells, mapping: str) -> bool:
    """Whether the table is read with a mapping, which may lack a rate."""
    wanted = yaml_model(mapping, TableColumns, name="mapping").completed(cells.stated)
    if wanted.fps is None:
        wanted = wanted.model_copy(update={"fps": 1.0})
    try:
        long, wanted, _ = in_rows(where, cells, wanted)
        frame = rows_of(where, long, columns_of(where, long, wanted), wanted).frame
    except FileError:
        return False
    places = frame[["agent", "episode", "time_s", "x", "y"]].drop_duplicates()
    again = places.duplicated(["agent", "episode", "time_s"]).mean()
    return bool(len(places) and again <= _REPEATED)


def id_columns(cells: Cells) -> list[int]:
    """Return the columns that may hold the ids of agents, which none of the names states.

    An id has several rows and is at most once at a time; columns of coordinates are none.
    """
    frame, names = cells.frame, cells.names
    times = [at for at, name in enumerate(names) if role_of(name) in ("time", "frame")]
    taken = {column for pair in pairs_of(names) for column in (pair.x, pair.y)}
    free = [at for at, name in enumerate(names) if role_of(name) is None and at not in taken]
    return [
        at
        for at in free
        if times
        and 2 <= frame.iloc[:, at].nunique() <= len(frame) / _FEWEST_ROWS
        and frame.iloc[:, [times[0], at]].duplicated().mean() <= _REPEATED
    ]


def _texts(names: Sequence[str], pair: Pair) -> list[str]:
    once = [list(names).count(names[at]) == 1 for at in (pair.x, pair.y)]
    return [
        names[at] if alone else str(at + 1)
        for at, alone in zip((pair.x, pair.y), once, strict=True)
    ]


def _unused(names: Sequence[str], pairs: Iterable[Pair], used: set[int]) -> str:
    left = [f"{names[each.x]}, {names[each.y]}" for each in pairs if not {each.x, each.y} & used]
    if not left:
        return ""
    return (
        f"the coordinates {' and '.join(left)} are not used; 'robot_columns:' and"
        " 'people_columns:' in a --mapping file name columns of agents"
    )


def _long(
    where: str,
    cells: Cells,
    wanted: TableColumns,
    robot: Pair | None,
    people: Sequence[Pair],
    rows: Pair | None,
) -> tuple[Cells, TableColumns]:
    """Return a row per agent and time, and the mapping of its columns."""
    import pandas as pd

    kept = _kept(where, cells, wanted)
    parts = []
    for pair, name in _agents(robot, people):
        part = cells.frame.iloc[:, [*kept.values(), pair.x, pair.y]].dropna()
        if pair is robot:
            part = part.drop_duplicates()  # each row of a person repeats it
        parts.append(part.set_axis(range(part.shape[1]), axis=1).assign(id=name))
    if rows is not None:
        column = column_named(where, cells.names, _ids(cells.names, wanted), "agent")
        part = cells.frame.iloc[:, [*kept.values(), rows.x, rows.y, column]].dropna()
        part = part.set_axis([*range(part.shape[1] - 1), "id"], axis=1)
        parts.append(part.assign(id=[_person(each) for each in part.id]))
    unit = wanted.unit or _unit(where, cells, [*people, *(each for each in (robot, rows) if each)])
    suffix = f" [{unit}]" if unit else ""
    names = (*(cells.names[at] for at in kept.values()), f"x{suffix}", f"y{suffix}", "id")
    numbers = {role: str(at) for at, role in enumerate(kept, start=1)}
    mapping = wanted.model_copy(
        update={**numbers, "x": str(len(kept) + 1), "y": str(len(kept) + 2)}
        | {"agent": str(len(kept) + 3), "robot_columns": (), "people_columns": ()}
    )
    return Cells(pd.concat(parts), names, cells.stated), mapping


def _kept(where: str, cells: Cells, wanted: TableColumns) -> dict[str, int]:
    """Return the columns of times and episodes by their roles."""
    first = next(iter(pairs_of(cells.names)), Pair("", 0, 0))
    axes = {
        "x": str(first.x + 1),
        "y": str(first.y + 1),
        "agent": "",
        "robot_columns": (),
        "people_columns": (),
    }
    found = columns_of(where, cells, wanted.model_copy(update=axes))
    return {role: found[role] for role in ("time", "episode") if found[role] >= 0}


def _agents(robot: Pair | None, people: Sequence[Pair]) -> list[tuple[Pair, str]]:
    named = [(pair, _person(pair.name.replace(" ", "_"))) for pair in people]
    return [*([(robot, "robot")] if robot else []), *named]


def _person(name: object) -> str:
    """Return the id of a person: a number alone is called `person 1`."""
    text = f"{name:g}" if isinstance(name, float) else str(name)
    return f"person {text}" if text.replace(".", "", 1).isdecimal() else text


def _unit(where: str, cells: Cells, pairs: Sequence[Pair]) -> str | None:
    units = {unit_of(cells.names[column]) for pair in pairs for column in (pair.x, pair.y)}
    if len(units) > 1:
        raise FileError(
            f"{where} must state one unit in the names of all coordinates; write that of all into a"
            " --mapping file, as {unit: m}, or export the table with one"
        )
    return units.pop()
