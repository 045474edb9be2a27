"""Tables with columns of their own for each agent, `robot_x, robot_y, person1_x, ...`, as rows of
time, id, x and y."""

import re
from typing import TYPE_CHECKING

from storage.trajectories.cells import Cells
from storage.trajectories.columns import UNIT_SUFFIX, role_of

if TYPE_CHECKING:
    import pandas as pd

_AXIS_LAST = re.compile(r"(?P<agent>.*?[^\W_])[\W_]*(?:pos(?:ition)?[\W_]*)?(?P<axis>[xy])$")
_AXIS_FIRST = re.compile(r"(?:pos(?:ition)?[\W_]*)?(?P<axis>[xy])[\W_]+(?P<agent>.*[^\W_])$")
#: What agents are called, with or without a number.
_AGENT = re.compile(
    r"(robot|ped|pedestrian|person|people|human|agent|walker|obstacle|actor|p|h|id)[\W_]*\d*$"
)
#: The agent whose columns have no name.
_OWN = "robot"


def long_cells(cells: Cells) -> Cells:
    """The same where there is one pair of x and y, else a row per agent and time."""
    pairs = _pairs(cells.names)
    times = [row for row, name in enumerate(cells.names) if role_of(name) in ("time", "frame")]
    if len(pairs) < 2 or not times:
        return cells
    unit = UNIT_SUFFIX.search(cells.names[pairs[next(iter(pairs))]["x"]].strip().lower())
    suffix = unit[0] if unit else ""
    names = (cells.names[times[0]], "id", f"x{suffix}", f"y{suffix}")
    return Cells(_stacked(cells.frame, times[0], pairs), names, cells.fps, cells.comments)


def _stacked(frame: "pd.DataFrame", time: int, pairs: dict[str, dict[str, int]]) -> "pd.DataFrame":
    import pandas as pd

    parts = [
        pd.DataFrame(
            {
                "time": frame.iloc[:, time],
                "id": agent,
                "x": frame.iloc[:, axes["x"]],
                "y": frame.iloc[:, axes["y"]],
            }
        ).dropna()
        for agent, axes in pairs.items()
    ]
    return pd.concat(parts, ignore_index=True)


def _pairs(names: tuple[str, ...]) -> dict[str, dict[str, int]]:
    """The columns of x and y of each agent that has both; none without agents that are named."""
    found: dict[str, dict[str, int]] = {}
    for column, name in enumerate(names):
        plain = UNIT_SUFFIX.sub("", name.strip().lower()).strip()
        if (role := role_of(name)) in ("x", "y"):
            found.setdefault(_OWN, {}).setdefault(role, column)
            continue
        match = _AXIS_LAST.match(plain) or _AXIS_FIRST.match(plain)
        if match and _AGENT.match(match["agent"]):
            found.setdefault(match["agent"], {}).setdefault(match["axis"], column)
    return {agent: axes for agent, axes in found.items() if len(axes) == 2}
