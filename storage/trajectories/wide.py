"""Tables with a pair of columns per agent (`robot_x, robot_y, person1_x, ...`) as rows of time, id,
x and y; seconds and nanoseconds in two columns become one.

Beside columns that name a robot, x and y are a person, and so are x1, y1, ...; without such columns
x and y are the robot beside numbered people.
"""

import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from storage.trajectories.cells import Cells
from storage.trajectories.columns import UNIT_SUFFIX, role_of
from storage.trajectories.episodes import restarts

if TYPE_CHECKING:
    import pandas as pd

_PLACE = r"(?:(?:p|pose|pos|position|loc|location|cent(?:er|re|roid))[\W_]*)*"
_AXIS_LAST = re.compile(rf"(?P<agent>.*?[^\W_])[\W_]*{_PLACE}(?P<axis>[xy])$")
_AXIS_FIRST = re.compile(rf"{_PLACE}(?P<axis>[xy])[\W_]+(?P<agent>.*[^\W_])$")
#: Columns of people beside a robot: x1, y1, ...
_NUMBERED = re.compile(rf"{_PLACE}(?P<axis>[xy])_?(?P<agent>\d+)$")
#: Names of agents, with or without a number.
_AGENT = re.compile(
    r"(robot|r|ped|pedestrian|person|people|human|agent|walker|obstacle|actor|p|h|id)[\W_]*\d*$"
)
#: The agent whose columns are x and y alone, and the letter that may stand for it.
_OWN, _OWN_LETTER = "robot", "r"
#: Names of the robot that demonstrates, and the person whose columns are x and y beside it.
_ROBOTS = frozenset(["robot", "ego"])
_PERSON = "person"
#: Words in names of columns with x or y that are no places.
_NO_PLACE = re.compile(
    r"(^|[\W_])(v|vel\w*|velocity|speed|acc\w*|a|orientation|quat\w*|q|rot\w*|ang\w*|imu|gyro|force|size"
    r"|dim\w*|twist|cov\w*|std|var\w*|normal|heading|linear|mag\w*)([\W_]|$)"
)
_WHOLE_S = re.compile(r"^(.*?)(?:sec|secs|seconds)$")
_REST_NS = "{}n{}", "{}nano{}"


def long_cells(cells: Cells) -> Cells:
    """A row per agent and time; the same cells where x and y are columns of one agent."""
    import pandas as pd

    cells = _with_whole_times(cells)
    roles = [role_of(name) for name in cells.names]
    pairs = _pairs(cells.names, numbered="agent" not in roles)
    times = [row for row, role in enumerate(roles) if role in ("time", "frame")]
    if not pairs or (pairs.keys() == {_OWN} and {"x", "y"} <= set(roles)) or not times:
        return cells
    used = {column for axes in pairs.values() for column in axes.values()}
    cells = replace(cells, unused=tuple(unused_places(cells.names, used)))
    unit = UNIT_SUFFIX.search(cells.names[pairs[next(iter(pairs))]["x"]].strip().lower())
    suffix = unit[0] if unit else ""
    begins_again = restarts(
        pd.to_numeric(cells.frame.iloc[:, times[0]], errors="coerce").to_numpy(dtype=np.float64)
    )
    if "episode" not in roles and begins_again.any():
        numbered_from_1 = cells.frame.assign(**{"episode of times": begins_again + 1})
        cells = replace(cells, frame=numbered_from_1, names=(*cells.names, "episode"))
        roles.append("episode")
    kept = {"time": times[0]} | ({"episode": roles.index("episode")} if "episode" in roles else {})
    names = (*(cells.names[row] for row in kept.values()), "id", f"x{suffix}", f"y{suffix}")
    ids = roles.index("agent") if "agent" in roles else None
    frame = _stacked(cells.frame, kept, pairs, ids)
    return replace(cells, frame=frame, names=names)


def _with_whole_times(cells: Cells) -> Cells:
    """The cells with seconds and their nanoseconds added in one column."""
    import pandas as pd

    plain = [name.strip().lower() for name in cells.names]
    for row, name in enumerate(plain):
        found = _WHOLE_S.match(name)
        end = name[len(found[1]) :] if found else ""
        rest = [each.format(found[1], end) for each in _REST_NS] if found else []
        column = next((plain.index(each) for each in rest if each in plain), None)
        if column is None:
            continue
        whole, parts = (
            pd.to_numeric(cells.frame.iloc[:, each], errors="coerce") for each in (row, column)
        )
        frame = cells.frame.copy()
        frame[frame.columns[row]] = whole + 1e-9 * parts
        names = (*cells.names[:row], "time [s]", *cells.names[row + 1 :])
        return replace(cells, frame=frame, names=names)
    return cells


def _stacked(
    frame: "pd.DataFrame", kept: dict[str, int], pairs: dict[str, dict[str, int]], ids: int | None
) -> "pd.DataFrame":
    """A row per agent and time. ids: column with the ids of agents whose names have no number."""
    import pandas as pd

    parts = []
    for agent, axes in pairs.items():
        part = pd.DataFrame({name: frame.iloc[:, row] for name, row in kept.items()})
        is_several = ids is not None and agent != _OWN and not agent[-1].isdigit()
        part["id"] = f"{agent} " + frame.iloc[:, ids].astype(str) if is_several else agent
        part["x"], part["y"] = (frame.iloc[:, axes[axis]] for axis in "xy")
        parts.append(part.dropna())
    return pd.concat(parts, ignore_index=True)


def _pairs(names: tuple[str, ...], *, numbered: bool) -> dict[str, dict[str, int]]:
    """The columns of x and y of each agent that has both.

    numbered: whether x1, y1 belong to a person where x and y belong to a robot.
    """
    found: dict[str, dict[str, int]] = {}
    own = {role for name in names if (role := role_of(name)) in ("x", "y")}
    robot = {match["axis"] for name in names if (match := _of_agent(name)) and _is_robot(match)}
    plain_agent = _PERSON if robot == {"x", "y"} else _OWN
    for column, name in enumerate(names):
        plain = _plain(name)
        match = _of_agent(name)
        number = _NUMBERED.match(plain) if numbered and {"x", "y"} in (own, robot) else None
        if match and _is_robot(match):
            found.setdefault(_OWN, {}).setdefault(match["axis"], column)
        elif match and len(match["agent"]) > 1 and _AGENT.match(match["agent"]):
            found.setdefault(match["agent"], {}).setdefault(match["axis"], column)
        elif (role := role_of(name)) in ("x", "y"):
            found.setdefault(plain_agent, {}).setdefault(role, column)
        elif number:
            found.setdefault(f"person {number['agent']}", {}).setdefault(number["axis"], column)
        elif match and _AGENT.match(match["agent"]):
            agent = _OWN if match["agent"] == _OWN_LETTER else match["agent"]
            found.setdefault(agent, {}).setdefault(match["axis"], column)
    return {agent: axes for agent, axes in found.items() if len(axes) == 2}


def unused_places(names: Sequence[str], used: Collection[int]) -> Iterator[str]:
    """Names of columns that hold places, by their names, and are not among the used ones."""
    for column, name in enumerate(names):
        plain = _plain(name)
        is_place = role_of(name) in ("x", "y") or _of_agent(name) or _NUMBERED.match(plain)
        if column not in used and is_place and not _NO_PLACE.search(plain):
            yield name


def _plain(name: str) -> str:
    return UNIT_SUFFIX.sub("", name.strip().lower()).strip()


def _of_agent(name: str) -> re.Match[str] | None:
    """The agent and the axis that the name of a column states."""
    plain = _plain(name)
    return _AXIS_LAST.match(plain) or _AXIS_FIRST.match(plain)


def _is_robot(match: re.Match[str]) -> bool:
    return match["agent"] in _ROBOTS
