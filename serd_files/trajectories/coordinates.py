"""Which columns of a table hold x and y, and of whom.

`robot_x, robot_y` are those of the robot, and `x, y` and `x1, y1` beside them those of people.
Beside people in columns of their own `x, y` are those of the robot. Where this is not certain, an
error shows the mapping to write.
"""

import re
from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from serd_bag.errors import FileError
from serd_core.arrays import FloatArray
from serd_files.trajectories.columns import (
    METRES,
    NAMES_OF_AXES,
    UNIT_SUFFIX,
    mapping_of,
    numeric,
    role_of,
    unit_of,
)

if TYPE_CHECKING:
    import pandas as pd

_PLACE = (
    r"(?:(?:p|pose|pos|position|loc|location|cent(?:er|re|roid)|coord|translation"
    r"|map|odom|world|global|local|est|gt|base|link|footprint)[\W_]*)*"
)
_AXIS_LAST = re.compile(rf"(?P<agent>.*?[^\W_])[\W_]*{_PLACE}(?P<axis>[xy])$")
_AXIS_FIRST = re.compile(rf"{_PLACE}(?P<axis>[xy])[\W_]+(?P<agent>.*[^\W_])$")
_NUMBERED = re.compile(rf"{_PLACE}(?P<axis>[xy])_?(?P<agent>\d+)$")
_ROBOT = re.compile(r"(?:(?:mobile[\W_]*)?(?:robot|agv|amr|ego)|r)[\W_]*\d*$")
_PERSON = re.compile(r"(?:ped|pedestrian|person|people|human|walker|obstacle|actor|p|h)[\W_]*\d*$")
#: Agents of which it is not known whether they are the robot.
_EITHER = re.compile(r"(?:agent|id)[\W_]*\d*$")
_AGENTS = (_ROBOT, _PERSON, _EITHER)
#: Words in names of numbers along x and y that are no places.
_NO_PLACE = re.compile(
    r"(?:^|[\W_])(?:v|vel|velocity|speed|twist|lin|linear|ang|angular|a|acc|accel|acceleration|force"
    r"|cmd|q|quat|quaternion|orientation|rot|rotation|cov|covariance|std|sigma|var|variance|err|error"
    r"|d|delta|diff|size|width|scale|resolution|dir|direction|mag|gyro|imu)(?:[\W_]|$)"
)
#: Words in names of places of something that is no agent.
_NO_AGENT = re.compile(
    r"(?:^|[\W_])(?:goal|target|start|initial|origin|end|dest|destination|waypoint|next|ref|reference"
    r"|desired|setpoint|lidar|laser|sensor|camera|marker|landmark|corner|min|max|image|pixel|closest"
    r"|nearest|offset|gaze)(?:[\W_]|\d|$)"
)
#: Values along one axis that differ by less than this share of their spread are the same.
_SAME = 1e-3
ROBOT, PERSON = "robot", "person"
_NUMBER = re.compile(r"(?:^mobile[\W_]*)|(?:[\W_\d]+$)")
_LIKE_PLACE = re.compile(r"(?:^|(?<=[\W_]))(?P<axis>[xy])(?=[\W_]|$)")
_LISTED = 6


class Pair(NamedTuple):
    """The columns of x and y of one agent."""

    x: int
    y: int


class _Named(NamedTuple):
    """A column of places. agent: empty for x and y alone; form: its name without the axis."""

    agent: str
    axis: str
    form: str
    column: int
    is_numbered: bool = False


def named_pairs(
    where: str,
    names: Sequence[str],
    frame: "pd.DataFrame",
    *,
    has_ids: bool,
    of_robot: Pair | None = None,
) -> tuple[dict[str, Pair], tuple[str, ...]]:
    """Return the columns of each agent, and sentences about columns that repeat others.

    The agent of x and y alone has an empty name. has_ids: whether a column has the ids of agents;
    without columns of a robot, numbers behind x and y are then no ids. of_robot: columns that a
    mapping names, beside which those of people are kept. Raises FileError if it is not certain
    whose the columns are.
    """
    values, named = _Values(names, frame), _all_named(names)
    if of_robot is not None:
        named = _beside(named, of_robot)
    if has_ids and not any(is_robot(each.agent) for each in named):
        named = [each for each in named if not each.is_numbered]
    pairs: dict[str, Pair] = {}
    for agent in dict.fromkeys(each.agent for each in named):
        candidates = _candidates([each for each in named if each.agent == agent])
        if len(candidates) > 1:
            candidates = [each for each in candidates if not values.is_empty(each)]
        if not values.are_same(candidates):
            raise _several(where, names, candidates)
        if candidates:
            pairs[agent] = candidates[0]
    own = pairs.pop("", None)
    if of_robot is not None:
        people = pairs if own is None else {**pairs, PERSON: own}
        return ({ROBOT: of_robot, **people} if people else {"": of_robot}), ()
    robots = {agent: pair for agent, pair in pairs.items() if is_robot(agent)}
    if robots:
        return _among_people(where, names, pairs, robots, own, values)
    numbered = {each.agent for each in named if each.is_numbered}
    if own is None:
        pairs = {agent: pair for agent, pair in pairs.items() if agent not in numbered}
    unknown = [each for each in _unknown(names) if not values.is_empty(each)]
    candidates = [own] if own else list(pairs.values())
    if own and pairs:
        unknown = [pair for agent, pair in pairs.items() if _EITHER.match(agent)]
    if candidates and not values.are_same([candidates[0], *unknown]):
        raise _several(where, names, [*candidates, *unknown])
    if own is None:
        return pairs, ()
    return ({ROBOT: own, **pairs} if pairs else {"": own}), ()


def _among_people(
    where: str,
    names: Sequence[str],
    pairs: dict[str, Pair],
    robots: dict[str, Pair],
    own: Pair | None,
    values: "_Values",
) -> tuple[dict[str, Pair], tuple[str, ...]]:
    """Return the pairs of robots and people; `own`, the pair of x and y alone, is of a person.

    Robots whose names differ by more than a number must be at the same places.
    """
    first = next(iter(robots))
    kinds = {_NUMBER.sub("", agent): pair for agent, pair in reversed(robots.items())}
    if not values.are_same(list(kinds.values())):
        raise _several(where, names, list(kinds.values())[::-1])
    if len(kinds) > 1:
        pairs = {each: pair for each, pair in pairs.items() if each == first or each not in robots}
    if own is None:
        return pairs, ()
    if values.are_same([own, robots[first]]):
        x, y, robot_x, robot_y = (names[column] for column in (*own, *robots[first]))
        return pairs, (f"columns {x} and {y} repeat {robot_x} and {robot_y}",)
    return {**pairs, PERSON: own}, ()


def _all_named(names: Sequence[str]) -> list[_Named]:
    """Return the columns whose names are those of places of an agent."""
    return [each for column, name in enumerate(names) if (each := _named(name, column))]


def _beside(named: Sequence[_Named], of_robot: Pair) -> list[_Named]:
    """Return the columns of people beside those of the robot.

    Columns of x and y alone, and of numbered ones, are of people if the robot's have its name.
    """
    own = [each for each in named if each.column in of_robot]
    has_name = len(own) == len(of_robot) and all(is_robot(each.agent) for each in own)
    return [
        each
        for each in named
        if each not in own
        and not is_robot(each.agent)
        and (has_name or (_PERSON.match(each.agent) and not each.is_numbered))
    ]


def is_robot(agent: str) -> bool:
    """Whether columns of an agent of that name are those of the robot."""
    return _ROBOT.match(agent) is not None


def mappings_of_places(names: Sequence[str]) -> str:
    """Return what a mapping file must hold, for each pair of columns that may hold places."""
    named = _all_named(names)
    pairs = sorted({*_candidates(named), *_unknown(names)})[:_LISTED]
    return " or ".join(mapping_of(names, x=pair.x, y=pair.y) for pair in pairs)


def _unknown(names: Sequence[str]) -> list[Pair]:
    """Return pairs of columns that may hold the places of an agent of an unknown name."""
    found = []
    for column, name in enumerate(names):
        whole = name.strip().lower()
        match = _LIKE_PLACE.search(whole)
        if match and not _named(name, column) and _is_like_place(name):
            found.append(_Named("", match["axis"], _form(whole, match), column))
    return [
        pair
        for pair in _candidates(found)
        if not any(_NO_AGENT.search(names[column].lower()) for column in pair)
    ]


def unused_places(names: Sequence[str], used: Collection[int]) -> tuple[str, ...]:
    """Return a sentence about columns that seem to hold places and are not used, if any are."""
    unused = [
        name
        for column, name in enumerate(names)
        if column not in used and (_named(name, column) or _is_like_place(name))
    ]
    if not unused:
        return ()
    listed = ", ".join(unused[:_LISTED]) + (", ..." if len(unused) > _LISTED else "")
    verb = "columns {} are" if len(unused) > 1 else "column {} is"
    return (
        f"{verb.format(listed)} not used; 'x:' and 'y:' in a --mapping file name the columns that"
        " are",
    )


def _named(name: str, column: int) -> _Named | None:
    """Read the agent and the axis from a name; returns None for names of other columns."""
    whole = name.strip().lower()
    plain = UNIT_SUFFIX.sub("", whole).strip()
    match = _AXIS_LAST.match(plain) or _AXIS_FIRST.match(plain)
    is_agent = match is not None and any(each.match(match["agent"]) for each in _AGENTS)
    role, number = role_of(name), _NUMBERED.match(plain)
    if match and is_agent and len(match["agent"]) > 1:
        return _Named(match["agent"], match["axis"], _form(whole, match), column)
    if role in ("x", "y"):
        return _Named("", role, _bare_form(whole, plain), column)
    if number:
        person = f"{PERSON} {number['agent']}"
        return _Named(person, number["axis"], _form(whole, number), column, is_numbered=True)
    if match and is_agent:
        agent = ROBOT if match["agent"] == "r" else match["agent"]
        return _Named(agent, match["axis"], _form(whole, match), column)
    return None


def _form(name: str, match: re.Match[str]) -> str:
    """Return the name without its axis, which x and y of one source have in common."""
    return name[: match.start("axis")] + "*" + name[match.end("axis") :]


def _bare_form(name: str, plain: str) -> str:
    """Return what the names of x and y alone have in common, as easting and northing do."""
    for names in NAMES_OF_AXES.values():
        if plain in names:
            return f"{names.index(plain)} {name[len(plain) :]}"
    return re.sub(r"[xy](?=[^xy]*$)", "*", name)


def _candidates(named: Sequence[_Named]) -> list[Pair]:
    """Return the pairs of columns of one form, or the only x and y if their forms differ."""
    forms: dict[tuple[str, int], dict[str, int]] = {}
    for each in named:
        again = sum(other.form == each.form and other.axis == each.axis for other in named
                    if other.column < each.column)  # fmt: skip
        forms.setdefault((each.form, again), {})[each.axis] = each.column
    pairs = [Pair(axes["x"], axes["y"]) for axes in forms.values() if len(axes) == 2]
    columns = {axis: [each.column for each in named if each.axis == axis] for axis in "xy"}
    if not pairs and [len(columns[axis]) for axis in "xy"] == [1, 1]:
        return [Pair(columns["x"][0], columns["y"][0])]
    return pairs


def _is_like_place(name: str) -> bool:
    """Whether the name is that of a place along x or y of something."""
    plain = UNIT_SUFFIX.sub("", name.strip().lower()).strip(" _")
    words = re.split(r"[\W_]+", plain)
    ends = len(words) > 1 and not {"x", "y"}.isdisjoint((words[0], words[-1]))
    return ends and not _NO_PLACE.search(plain)


def _several(where: str, names: Sequence[str], candidates: Sequence[Pair]) -> FileError:
    """Return the error about pairs of columns, one of which a mapping must choose."""
    listed = " and ".join(f"{names[pair.x]}, {names[pair.y]}" for pair in candidates)
    mappings = " or ".join(mapping_of(names, x=pair.x, y=pair.y) for pair in candidates)
    return FileError(
        f"{where} must have one pair of columns for the robot, or for x and y, it has {listed},"
        f" whose values differ; write one of them into a --mapping file: {mappings}"
    )


class _Values:
    """Numbers of columns in the unit that their names state."""

    def __init__(self, names: Sequence[str], frame: "pd.DataFrame") -> None:
        self._names, self._frame = names, frame

    def are_same(self, pairs: Sequence[Pair]) -> bool:
        """Whether all pairs hold the same places in the rows in which they have numbers."""
        return all(
            self._same(pairs[0].x, other.x) and self._same(pairs[0].y, other.y)
            for other in pairs[1:]
        )

    def is_empty(self, pair: Pair) -> bool:
        """Whether a column of the pair holds no number."""
        return not all(np.isfinite(self._numbers(column)).any() for column in pair)

    def _same(self, one: int, other: int) -> bool:
        a, b = self._numbers(one), self._numbers(other)
        known = np.isfinite(a) & np.isfinite(b)
        if not known.any():
            return False
        spread = max(float(np.ptp(a[known])), float(np.ptp(b[known])))
        return bool(np.abs(a - b)[known].max() <= _SAME * spread)

    def _numbers(self, column: int) -> FloatArray:
        given = numeric(self._frame.iloc[:, column])
        numbers: FloatArray = given.to_numpy(dtype=np.float64)
        return numbers * (unit_of(self._names[column], METRES) or 1.0)
