"""What the names of a table's columns state: roles, places of agents, and units.

The names are a closed set, which docs/sources.md lists. A name without a unit states seconds or
metres, as messages of ROS do; all else is stated by a mapping.
"""

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
import yaml

from serd_bag.errors import FileError
from serd_core.arrays import FloatArray
from serd_files.settings import setting
from serd_files.yaml_config import StrictModel

if TYPE_CHECKING:
    import pandas as pd

METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001}
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_NAMES = {
    "time": ("time", "timestamp", "stamp", "t"),
    "frame": ("frame", "frame_id", "fr"),
    "agent": ("id", "agent", "agent_id", "person", "person_id", "ped", "ped_id", "pedestrian",
              "pedestrian_id", "track", "track_id"),
    "episode": ("episode", "episode_id", "run", "run_id", "trial", "trial_id", "scene", "scene_id"),
}  # fmt: skip
_ROLE_OF = {name: role for role, names in _NAMES.items() for name in names}
_UNIT = re.compile(r"(?:[\s_/]+|\s*[\[(]\s*)(m|cm|mm|s|ms|us|ns)\s*[\])]?\s*$")
_CAMEL = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")
_WORD = re.compile(r"[^\W\d_]+|\d+")
#: Names of an axis.
_AXES = {"x": "x", "y": "y", "px": "x", "py": "y", "tx": "x", "ty": "y", "rx": "x", "ry": "y"}
_KIND_OF = {
    **dict.fromkeys(["robot", "agv", "amr", "ego", "r"], "robot"),
    **dict.fromkeys(["person", "people", "ped", "pedestrian", "human", "walker"], "person"),
    **dict.fromkeys(["obstacle", "actor", "p", "h"], "person"),
    **dict.fromkeys(["agent", "id"], "either"),
}
#: Words for a place, which may precede or follow the axis.
_PLACE = frozenset(["position", "pos", "pose", "location", "center", "map", "odom", "world",
                    "global", "local", "field"])  # fmt: skip
#: Words in names of numbers along x and y that are no places.
_NO_PLACE = frozenset(["v", "vel", "velocity", "speed", "twist", "linear", "angular", "acc", "cmd",
                       "acceleration", "force", "q", "orientation", "quaternion", "cov", "std",
                       "covariance", "error", "direction", "size"])  # fmt: skip
#: Words in names of places of something that is no agent.
_NO_AGENT = frozenset(["goal", "target", "start", "end", "destination", "waypoint", "reference",
                       "lidar", "laser", "sensor", "camera", "marker", "image"])  # fmt: skip


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


class Place(NamedTuple):
    """What the name of a column of places states.

    agent: its name, empty for x and y alone. kind: robot, person, numbered (`x1`), either
    (`agent_x`), own (x and y alone), unknown (`spot_x`) or other (`goal_x`). form: the name
    without its axis, which x and y of one source have in common.
    """

    agent: str
    axis: str
    kind: str
    form: tuple[str, ...]
    column: int


def role_of(name: str) -> str | None:
    """Return what the name of a column stands for: frame, time, agent, episode, x or y."""
    role = _ROLE_OF.get("_".join(word.lower() for word in _WORD.findall(_plain(name))))
    place = None if role else place_of(name)
    return place.axis if place and place.kind == "own" else role


def place_of(name: str, column: int = 0) -> Place | None:
    """Return the agent and the axis that a name states, or None for names of other columns.

    >>> place_of("robot_pose_x").agent, place_of("y [cm]").axis, place_of("yaw")
    ('robot', 'y', None)
    """
    plain = _plain(name)
    words = [(word[0].lower(), word.span()) for word in _WORD.finditer(plain)]
    axes = [at for at, (word, _) in enumerate(words) if word in _AXES]
    if len(axes) != 1 or any(word in _NO_PLACE for word, _ in words):
        return None
    at, unit = axes[0], unit_of(name) or ""
    axis = _AXES[words[at][0]]
    form = (*(word[:-1] + "*" if row == at else word for row, (word, _) in enumerate(words)), unit)
    rest = [row for row, (word, _) in enumerate(words) if row != at and word not in _PLACE]
    texts = [words[row][0] for row in rest]
    if not rest:
        is_robot = words[at][0].startswith("r")
        return Place(*("robot", axis, "robot") if is_robot else ("", axis, "own"), form, column)
    if not _NO_AGENT.isdisjoint(texts):
        return Place("", axis, "other", form, column)
    if all(map(str.isdecimal, texts)):
        return Place(f"person {'_'.join(texts)}", axis, "numbered", form, column)
    is_around = rest[0] < at < rest[-1]
    whole = plain[words[rest[0]][1][0] : words[rest[-1]][1][1]].lower()
    named = {word for word in texts if not word.isdecimal()} - {"mobile"}
    kind = _KIND_OF.get(named.pop(), "unknown") if len(named) == 1 else "unknown"
    return Place("".join(texts) if is_around else whole, axis, kind, form, column)


def _plain(name: str) -> str:
    """Return the name without its unit, words of camel case divided."""
    return _CAMEL.sub("_", _UNIT.sub("", name.strip()))


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


def column_named(where: str, names: Sequence[str], text: str, role: str) -> int:
    """Return the column that a mapping names for a role; FileError if the table has none such."""
    if text in names:
        return list(names).index(text)
    if text.isdecimal() and 1 <= int(text) <= len(names):
        return int(text) - 1
    raise FileError(
        f"{where}: {role} must be one of the columns {', '.join(names)}, got {text!r}; correct the"
        " mapping"
    )


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
