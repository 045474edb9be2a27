"""Which columns of a table hold the time, the ids, and the places of which agent.

`robot_x, robot_y` are those of the robot, and `x, y` and `x1, y1` beside them those of people.
Beside people in columns of their own `x, y` are those of the robot. Where this is not certain, an
error shows the mapping to write.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from serd_bag.errors import FileError
from serd_core.arrays import FloatArray
from serd_files.trajectories.cells import Cells
from serd_files.trajectories.columns import (
    METRES,
    Place,
    TableColumns,
    column_named,
    mapping_of,
    numeric,
    place_of,
    role_of,
    unit_of,
)

#: Values along one axis that differ by less than this share of their spread are the same.
_SAME = 1e-3
ROBOT, PERSON = "robot", "person"
_LISTED = 6
#: Kinds of agents whose columns are used.
_KNOWN = ("robot", "own", "numbered", "either", "person")
_NUMBER = re.compile(r"^mobile[\W_]*|[\W_\d]+$")


class Pair(NamedTuple):
    """The columns of x and y of one agent."""

    x: int
    y: int


@dataclass(frozen=True)
class Columns:
    """Numbers of columns, -1 for ids and episodes where the table has none.

    pairs: by agent; the key is empty where one pair holds the places of all agents. remarks:
    sentences about columns that are not used.
    """

    time: int
    agent: int
    episode: int
    pairs: Mapping[str, Pair]
    remarks: tuple[str, ...] = ()


def columns_of(where: str, cells: Cells, wanted: TableColumns) -> Columns:
    """Return the columns of a table; raises FileError where they are missing or not certain."""
    names = cells.names
    roles = ("time", "agent", "episode", "x", "y")
    given = {
        role: column_named(where, names, text, role)
        for role in roles
        if (text := getattr(wanted, role))
    }
    by_name = {role_of(name): column for column, name in reversed(list(enumerate(names)))}
    found = {role: by_name[role] for role in (*roles, "frame") if role in by_name} | given
    if "time" not in given:
        _require_one_time(where, cells)
        found.setdefault("time", found.get("frame", -1))
    places = [place for column, name in enumerate(names) if (place := place_of(name, column))]
    pairs = _pairs(where, cells, places, found, given)
    if found["time"] < 0 or not pairs:
        raise _missing(where, names, places, found, has_pairs=bool(pairs))
    used = {column for pair in pairs.values() for column in pair}
    remarks = _unused([names[place.column] for place in places if place.column not in used])
    return Columns(found["time"], found.get("agent", -1), found.get("episode", -1), pairs, remarks)


def _require_one_time(where: str, cells: Cells) -> None:
    """Raise FileError with the mappings to write if several columns hold times."""
    names = cells.names
    times = [column for column, name in enumerate(names) if role_of(name) == "time"]
    clocks = [each for each in times if np.isfinite(numeric(cells.frame.iloc[:, each])).any()]
    if len(clocks) > 1:
        mappings = " or ".join(mapping_of(names, time=column) for column in clocks)
        raise FileError(
            f"{where} must have one column of times, it has"
            f" {' and '.join(names[column] for column in clocks)}; write one of them into a"
            f" --mapping file: {mappings}"
        )


def _pairs(
    where: str,
    cells: Cells,
    places: Sequence[Place],
    found: Mapping[str, int],
    given: Mapping[str, int],
) -> dict[str, Pair]:
    """Return the columns of each agent, none where there are none."""
    if given.keys() >= {"x", "y"}:
        return _beside(where, cells, places, Pair(given["x"], given["y"]))
    if "x" in given or "y" in given:
        return {"": Pair(found["x"], found["y"])} if {"x", "y"} <= found.keys() else {}
    by_kind: dict[str, dict[str, Pair]] = {kind: {} for kind in (*_KNOWN, "unknown", "other")}
    for place in places:
        kind = by_kind[place.kind]
        if place.agent not in kind and place.kind in _KNOWN:
            kind |= _of_agent(where, cells, places, place.agent)
    robots, own, people = by_kind["robot"], by_kind["own"], by_kind["person"]
    either, numbered = by_kind["either"], by_kind["numbered"]
    if "agent" in found and not robots:  # ids are in a column, so numbers behind x are none
        numbered = {}
    unknown = [pair for pair in _candidates([place for place in places if place.kind == "unknown"])
               if not _is_empty(cells, pair)]  # fmt: skip
    if robots:
        first = next(iter(robots.values()))
        kinds = {_NUMBER.sub("", agent): pair for agent, pair in reversed(robots.items())}
        _require_same(where, cells, list(kinds.values())[::-1])
        one = robots if len(kinds) == 1 else dict([next(iter(robots.items()))])
        persons = {**people, **either, **numbered}
        if own and not _are_same(cells, first, own[""]):
            persons[PERSON] = own[""]
        return one | persons
    if own:
        _require_same(where, cells, [own[""], *either.values(), *unknown])
        return {ROBOT: own[""], **people, **numbered} if people or numbered else own
    if people or either:
        _require_same(where, cells, [*people.values(), *either.values()][:1] + unknown)
    return {**people, **either}


def _beside(where: str, cells: Cells, places: Sequence[Place], of_robot: Pair) -> dict[str, Pair]:
    """Return the columns that a mapping names, and those of people beside them.

    Columns of x and y alone, and of numbered ones, are of people if the robot's have its name.
    """
    own = [place for place in places if place.column in of_robot]
    has_name = len(own) == len(of_robot) and all(place.kind == "robot" for place in own)
    kinds = [*_KNOWN[1:]] if has_name else ["person"]
    beside = [place for place in places if place.kind in kinds and place not in own]
    people: dict[str, Pair] = {}
    for agent in dict.fromkeys(place.agent for place in beside):
        people |= _of_agent(where, cells, beside, agent)
    people = {agent or PERSON: pair for agent, pair in people.items()}
    return {ROBOT: of_robot, **people} if people else {"": of_robot}


def _of_agent(where: str, cells: Cells, places: Sequence[Place], agent: str) -> dict[str, Pair]:
    """Return the pair of an agent, if it has one; raises FileError for two that differ."""
    pairs = _candidates([each for each in places if each.agent == agent and each.kind != "other"])
    if len(pairs) > 1:
        pairs = [pair for pair in pairs if not _is_empty(cells, pair)]
    _require_same(where, cells, pairs)
    return dict.fromkeys([agent], pairs[0]) if pairs else {}


def _candidates(places: Sequence[Place]) -> list[Pair]:
    """Return the pairs of columns of one agent and form."""
    forms: dict[tuple[object, ...], dict[str, int]] = {}
    for place in places:
        key = (place.agent, place.form)
        again = sum(place.axis in axes for known, axes in forms.items() if known[:2] == key)
        forms.setdefault((*key, again), {})[place.axis] = place.column
    return [Pair(axes["x"], axes["y"]) for axes in forms.values() if len(axes) == 2]


def _missing(
    where: str,
    names: Sequence[str],
    places: Sequence[Place],
    found: Mapping[str, int],
    *,
    has_pairs: bool,
) -> FileError:
    """Return the error about columns that are missing, with mappings of those that are there.

    Columns that may hold places are proposed as x and y, others in the order of the table.
    """
    likely = [] if has_pairs else _candidates([each for each in places if each.kind != "other"])
    lacking = ["time"] if found["time"] < 0 else []
    needed = lacking if has_pairs or likely else [*lacking, "x", "y"]
    lacking = lacking if has_pairs else [*lacking, "x", "y"]
    verb = "is" if len(lacking) == 1 else "are"
    sentence = (
        f"{where} must have columns of time, x and y, {' and '.join(lacking)} {verb} not among"
        f" {', '.join(names)}"
    )
    of_places = {place.column for place in places if has_pairs or likely}
    rest = [each for each in range(len(names)) if each not in {*found.values(), *of_places}]
    if len(rest) < len(needed):
        return FileError(f"{sentence}; export the table with them")
    if len(rest) > len(needed) > 1 and "agent" not in found:
        needed = [*needed[:-2], "agent", "x", "y"]
    rest.sort(key=lambda column: "time" not in names[column].lower())
    chosen = dict(zip(needed, rest, strict=False))
    options = [{**chosen, **pair._asdict()} for pair in likely[:_LISTED]] or [chosen]
    mappings = " or ".join(mapping_of(names, **option) for option in options)
    return FileError(f"{sentence}; name the columns in a --mapping file, as {mappings}")


def _unused(names: Sequence[str]) -> tuple[str, ...]:
    """Return a sentence about columns that seem to hold places and are not used, if any are."""
    if not names:
        return ()
    listed = ", ".join(names[:_LISTED]) + (", ..." if len(names) > _LISTED else "")
    verb = "columns {} are" if len(names) > 1 else "column {} is"
    return (
        f"{verb.format(listed)} not used; 'x:' and 'y:' in a --mapping file name the columns that"
        " are",
    )


def _require_same(where: str, cells: Cells, pairs: Sequence[Pair]) -> None:
    """Raise FileError with the mappings to write if pairs of columns hold different places."""
    if all(_are_same(cells, pairs[0], pair) for pair in pairs[1:]):
        return
    names = cells.names
    listed = " and ".join(f"{names[pair.x]}, {names[pair.y]}" for pair in pairs)
    mappings = " or ".join(mapping_of(names, x=pair.x, y=pair.y) for pair in pairs)
    raise FileError(
        f"{where} must have one pair of columns for the robot, or for x and y, it has {listed},"
        f" whose values differ; write one of them into a --mapping file: {mappings}"
    )


def _are_same(cells: Cells, one: Pair, other: Pair) -> bool:
    """Whether two pairs hold the same places in the rows in which they have numbers."""
    for a, b in zip(_places(cells, one), _places(cells, other), strict=True):
        known = np.isfinite(a) & np.isfinite(b)
        spread = max(float(np.ptp(a[known])), float(np.ptp(b[known]))) if known.any() else -1.0
        if spread < 0 or np.abs(a - b)[known].max() > _SAME * spread:
            return False
    return True


def _is_empty(cells: Cells, pair: Pair) -> bool:
    """Whether a column of the pair holds no number."""
    return not all(np.isfinite(values).any() for values in _places(cells, pair))


def _places(cells: Cells, pair: Pair) -> list[FloatArray]:
    """Return x and y in the unit that their names state."""
    units = [METRES.get(unit_of(cells.names[column]) or "m", 1.0) for column in pair]
    columns = (numeric(cells.frame.iloc[:, column]) for column in pair)
    return [unit * column for unit, column in zip(units, columns, strict=True)]
