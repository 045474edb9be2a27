"""Tables with a pair of columns per agent (`robot_x, robot_y, person1_x, ...`) as rows of time, id,
x and y; seconds and nanoseconds in two columns become one."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from serd_bag.errors import FileError
from serd_files.trajectories.cells import Cells
from serd_files.trajectories.columns import (
    METRES,
    TableColumns,
    column_named,
    columns_by_name,
    numeric,
    require_one_time,
    unit_of,
)
from serd_files.trajectories.coordinates import (
    Pair,
    is_robot,
    mappings_of_places,
    named_pairs,
    unused_places,
)
from serd_files.trajectories.episodes import restarts

#: Ids of the people whose x and y are beside robot_x and robot_y, as NavWareSet names the column.
_PERSON_ID = "column"
_WHOLE_S = re.compile(r"^(.*?)(?:sec|secs|seconds)$")
_REST_NS = "{}n{}", "{}nano{}"


@dataclass(frozen=True, eq=False)
class LongCells:
    """Cells with a row per agent and time, and the mapping for their columns.

    remarks: sentences about columns that are not used, or assumed to be of an agent.
    """

    cells: Cells
    wanted: TableColumns
    remarks: tuple[str, ...] = ()


def long_cells(where: str, cells: Cells, wanted: TableColumns) -> LongCells:
    """Bring the places of all agents into one column of x and one of y.

    Cells in which x and y are columns of one agent stay as they are. Raises FileError if it is not
    certain which columns hold the times, or the places of an agent.
    """
    cells = _with_whole_times(cells)
    names, count = cells.names, cells.frame.shape[1]
    given = {
        role: column_named(where, names, count, text, role)
        for role in ("time", "agent", "episode", "x", "y")
        if (text := getattr(wanted, role))
    }
    if not names:
        return LongCells(cells, wanted)
    if "time" not in given:
        require_one_time(where, names, cells.frame)
    found = columns_by_name(names) | given
    used = [found[axis] for axis in ("x", "y") if axis in given]
    if len(used) == 1:
        return LongCells(cells, wanted, unused_places(names, used))
    of_robot = Pair(*used) if used else None
    pairs, remarks = named_pairs(
        where, names, cells.frame, has_ids="agent" in found, of_robot=of_robot
    )
    time = found.get("time", found.get("frame"))
    if not pairs and (mappings := mappings_of_places(names)):
        raise FileError(
            f"{where} must have columns of x and y, named so, or robot_x and robot_y, among"
            f" {', '.join(names)}; write them into a --mapping file, as {mappings}"
        )
    used = [column for pair in pairs.values() for column in pair]
    remarks = (*remarks, *unused_places(names, used))
    if pairs.keys() <= {""} or time is None:
        numbers = {axis: str(column + 1) for axis, column in zip("xy", used, strict=False)}
        return LongCells(cells, wanted.model_copy(update=numbers), remarks)
    long = _stacked(where, cells, pairs, found | {"time": time}, wanted)
    return replace(long, remarks=(*remarks, *long.remarks))


def _with_whole_times(cells: Cells) -> Cells:
    """The cells with seconds and their nanoseconds added in one column."""
    plain = [name.strip().lower() for name in cells.names]
    for row, name in enumerate(plain):
        found = _WHOLE_S.match(name)
        end = name[len(found[1]) :] if found else ""
        rest = [each.format(found[1], end) for each in _REST_NS] if found else []
        column = next((plain.index(each) for each in rest if each in plain), None)
        if column is None:
            continue
        whole, parts = (numeric(cells.frame.iloc[:, each]) for each in (row, column))
        frame = cells.frame.copy()
        frame[frame.columns[row]] = whole + 1e-9 * parts
        names = (*cells.names[:row], "time [s]", *cells.names[row + 1 :])
        return replace(cells, frame=frame, names=names)
    return cells


def _stacked(
    where: str,
    cells: Cells,
    pairs: Mapping[str, Pair],
    found: Mapping[str, int],
    wanted: TableColumns,
) -> LongCells:
    """Put the rows of all agents below each other.

    found: columns of the time, of episodes and of the ids of people.
    """
    import pandas as pd

    frame, names = cells.frame, cells.names
    columns = {role: found[role] for role in ("time", "episode") if role in found}
    kept = pd.DataFrame({role: frame.iloc[:, column] for role, column in columns.items()})
    titles = [names[column] for column in columns.values()]
    times = numeric(kept["time"]).to_numpy(dtype=np.float64)
    begins_again = restarts(times)
    if "episode" not in columns and begins_again.any():
        kept["episode"] = begins_again + 1
        titles.append("episode")
    ids = found.get("agent", names.index(_PERSON_ID) if _PERSON_ID in names else None)
    scale_of, unit, remarks = _units(where, names, pairs, wanted)
    parts = []
    for agent, pair in pairs.items():
        part = kept.copy()
        is_several = ids is not None and not is_robot(agent) and not agent[-1].isdigit()
        part["id"] = f"{agent} " + frame.iloc[:, ids].map(_id) if is_several else agent
        for axis, column in pair._asdict().items():
            given, scale = frame.iloc[:, column], scale_of[column]
            part[axis] = given if scale == 1.0 else scale * numeric(given)
        parts.append(part.dropna())
    long = replace(
        cells,
        frame=pd.concat(parts, ignore_index=True),
        names=(*titles, "id", *(f"{axis} [{unit}]" if unit else axis for axis in "xy")),
    )
    of_rows = {"time": titles[0] if wanted.time else "", "agent": "", "x": "", "y": ""}
    of_rows["episode"] = titles[1] if wanted.episode else ""
    return LongCells(long, wanted.model_copy(update=of_rows), remarks)


def _id(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _units(
    where: str, names: Sequence[str], pairs: Mapping[str, Pair], wanted: TableColumns
) -> tuple[dict[int, float], str, tuple[str, ...]]:
    """Return a factor for each column, the unit that all have then, and a remark.

    The unit is empty if no name states one. The remark names columns that are assumed to have the
    unit of the others.
    """
    metres = {column: unit_of(names[column], METRES) for pair in pairs.values() for column in pair}
    one = dict.fromkeys(metres, 1.0)
    stated = {value for value in metres.values() if value is not None}
    silent = [names[column] for column, value in metres.items() if value is None]
    if wanted.unit is not None or not stated:
        return one, "", ()
    if len(stated) > 1 and silent:
        raise FileError(
            f"{where} must state the units of all places or of none, those of {', '.join(silent)}"
            " are not stated; write them behind the names, as in x [m], or unit: into a --mapping"
            " file"
        )
    if len(stated) > 1:
        return {column: value or 1.0 for column, value in metres.items()}, "m", ()
    unit = next(name for name, value in METRES.items() if value in stated)
    remark = f"places of {', '.join(silent)} are taken in {unit}, as the others"
    return one, unit, (remark,) if silent else ()
