"""Which columns of a table hold the time, the ids and the places.

The names are a closed set, which docs/sources.md lists; all else is stated by a mapping. Where
several columns may hold the places, an error shows the mapping to write.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

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
_AXES = frozenset(["x", "y", "px", "py", "tx", "ty", "rx", "ry"])
#: Words for a place, which may precede or follow the axis.
_PLACE = frozenset(["position", "pos", "pose", "location", "center", "map", "odom", "world",
                    "global", "local", "field"])  # fmt: skip
#: Words in names of numbers along x and y that are places of no agent.
_OTHER = frozenset(["v", "vel", "velocity", "speed", "twist", "linear", "angular", "acc", "cmd",
                    "acceleration", "force", "q", "orientation", "quaternion", "cov", "std",
                    "covariance", "error", "direction", "size", "goal", "target", "start", "end",
                    "destination", "waypoint", "reference", "lidar", "laser", "sensor", "camera",
                    "marker", "image"])  # fmt: skip
_LISTED = 6


class TableColumns(StrictModel):
    """Names of the columns, or their numbers from 1; empty: found by their names."""

    time: str = setting("", "column of times or frames: its name, or its number from 1")
    agent: str = setting("", "column of ids")
    episode: str = setting("", "column of episodes, in each of which ids and times may begin again")
    x: str = setting("", "column of x")
    y: str = setting("", "column of y")
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


@dataclass(frozen=True)
class Columns:
    """Numbers of columns, -1 for ids and episodes where the table has none.

    remarks: sentences about columns that are not used.
    """

    time: int
    agent: int
    episode: int
    x: int
    y: int
    remarks: tuple[str, ...] = ()


def role_of(name: str) -> str | None:
    """Return what the name of a column stands for: frame, time, agent, episode, x or y."""
    words = [word.lower() for word in _WORD.findall(_plain(name))]
    axis = axis_of(name)
    if axis is None or set(words) - _PLACE not in ({axis}, {f"p{axis}"}, {f"t{axis}"}):
        return _ROLE_OF.get("_".join(words))
    return axis


def axis_of(name: str) -> str | None:
    """Return the axis of the places of some agent that a name states, or None.

    >>> axis_of("robot_pose_x"), axis_of("y [cm]"), axis_of("goal_x"), axis_of("yaw")
    ('x', 'y', None, None)
    """
    words = [word.lower() for word in _WORD.findall(_plain(name))]
    axes = [word for word in words if word in _AXES]
    return axes[0][-1] if len(axes) == 1 and _OTHER.isdisjoint(words) else None


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
    text = yaml.safe_dump(chosen, default_flow_style=True, width=10_000, allow_unicode=True)
    return str(text).strip()


def columns_of(where: str, cells: "Cells", wanted: TableColumns) -> Columns:
    """Return the columns of a table; raises FileError where they are missing or not certain."""
    names = cells.names
    found = {role: at for at, name in reversed(list(enumerate(names))) if (role := role_of(name))}
    given = {
        role: _column_named(where, names, text, role)
        for role in ("time", "agent", "episode", "x", "y")
        if (text := getattr(wanted, role))
    }
    found |= given
    places = [at for at, name in enumerate(names) if axis_of(name)]
    if "time" not in given:
        _require_one_time(where, cells)
        found.setdefault("time", found.get("frame", -1))
    if found["time"] < 0 or not {"x", "y"} <= found.keys():
        raise _missing(where, names, found, places)
    if not given.keys() & {"x", "y"} and len(places) > 2:
        fix = mapping_of(names, x=found["x"], y=found["y"])
        raise FileError(
            f"{where} must have one column of x and one of y, it has"
            f" {', '.join(names[at] for at in places)}; give each agent rows of its own, or write"
            f" those of one into a --mapping file: {fix}"
        )
    unused = [names[at] for at in places if at not in (found["x"], found["y"])]
    remarks: tuple[str, ...] = ()
    if unused:
        listed = ", ".join(unused[:_LISTED]) + (", ..." if len(unused) > _LISTED else "")
        remarks = (f"{listed} {'are' if len(unused) > 1 else 'is'} not used",)
    time, x, y = (found[role] for role in ("time", "x", "y"))
    return Columns(time, found.get("agent", -1), found.get("episode", -1), x, y, remarks)


def _column_named(where: str, names: Sequence[str], text: str, role: str) -> int:
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
    clocks = [
        at
        for at, name in enumerate(names)
        if role_of(name) == "time" and np.isfinite(numeric(cells.frame.iloc[:, at])).any()
    ]
    if len(clocks) > 1:
        raise FileError(
            f"{where} must have one column of times, it has"
            f" {' and '.join(names[at] for at in clocks)}; write one of them into a --mapping file:"
            f" {' or '.join(mapping_of(names, time=at) for at in clocks)}"
        )


def _missing(
    where: str, names: Sequence[str], found: Mapping[str, int], places: Sequence[int]
) -> FileError:
    """Return the error about columns that are missing, with a mapping in the order of the table."""
    lacking = [role for role in ("time", "x", "y") if found.get(role, -1) < 0]
    sentence = (
        f"{where} must have columns of time, x and y, {' and '.join(lacking)}"
        f" {'is' if len(lacking) == 1 else 'are'} not among {', '.join(names)}"
    )
    near = {axis_of(names[at]): at for at in reversed(places)}
    chosen = {role: near[role] for role in lacking if role in near}
    needed = [role for role in lacking if role not in chosen]
    taken = {*found.values(), *places}
    rest = [column for column in range(len(names)) if column not in taken]
    if len(rest) < len(needed):
        return FileError(f"{sentence}; export the table with them")
    if len(rest) > len(needed) > 1 and "agent" not in found:
        needed = [*needed[:-2], "agent", "x", "y"]
    rest.sort(key=lambda column: "time" not in names[column].lower())
    mapping = mapping_of(names, **dict(zip(needed, rest, strict=False)), **chosen)
    return FileError(f"{sentence}; name the columns in a --mapping file, as {mapping}")
