"""Public layouts, recognised by their exact header or form, and what each of them states.

| layout | form | states |
| --- | --- | --- |
| ETH/UCY | 4 numbers: frame, id, x, y; frames in steps of 10 | 25 frames per second, m |
| Jülich archive | a comment `framerate: 25`, or 5 numbers: id, frame, x, y, z | rate, cm |
| TUM | timestamp tx ty tz qx qy qz qw | s, m |
| KITTI | rows of 12 numbers, 3 x 4 matrices of camera poses | 10 rows per second, m; x, z |
| NavWareSet | timestamp, robot_x, robot_y, and x, y, column or x1, y1, x2, ... | ns, m |
| rostopic echo -p | %time, field.... | ns, m |
| fields of a ROS message | ...stamp.sec, ...stamp.nanosec | s, m |
"""

import re
from dataclasses import replace

import numpy as np

from serd_core.arrays import FloatArray
from serd_files.trajectories.cells import Cells
from serd_files.trajectories.columns import TableColumns, numeric, role_of

_TUM = ("timestamp", "tx", "ty", "tz", "qx", "qy", "qz", "qw")
_N_MATRIX, _KITTI_FPS = 12, 10.0
_KITTI = {3: "x", 11: "y"}
_ETH, _ETH_STEP, _ETH_FPS = ("frame", "id", "x", "y"), 10, 25.0
_JUELICH = ("id", "frame", "x", "y", "z")
_RATE = re.compile(r"frame\s*-?rate\D{0,5}(\d+(?:\.\d+)?)", re.IGNORECASE)
_IN_M = re.compile(r"\bin m\b")
_NAVWARE_1 = {"timestamp", "x", "y", "column", "robot_x", "robot_y"}
_NAVWARE_2 = {"timestamp", "robot_x", "robot_y", "x1", "y1"}
_STAMP = re.compile(r"(.*stamp\.)(secs?)")
_REST_NS = {"sec": "nanosec", "secs": "nsecs"}


def with_layout(cells: Cells, wanted: TableColumns) -> tuple[Cells, TableColumns]:
    """Return the cells with the names of their layout, and the mapping with what it states.

    What the mapping states stays. Tables of no public layout are returned as they are.
    """
    if not cells.has_names:
        return _without_names(cells, wanted)
    if cells.names == _TUM:
        return cells, _stating(wanted, time_unit="s", unit="m")
    if cells.names[0] == "%time":
        return cells, _stating(wanted, time_unit="ns", unit="m")
    if set(cells.names) >= _NAVWARE_1:
        return cells, _stating(wanted, agent="column", time_unit="ns", unit="m")
    if set(cells.names) >= _NAVWARE_2:
        return cells, _stating(wanted, time_unit="ns", unit="m")
    rate = None if any(role_of(name) == "time" for name in cells.names) else _rate(cells)
    return _with_stamps(cells), _stating(wanted, fps=rate)


def _without_names(cells: Cells, wanted: TableColumns) -> tuple[Cells, TableColumns]:
    """Recognise a layout by the number of columns, and by its form where others have as many."""
    count, rate = cells.frame.shape[1], _rate(cells)
    if rate is not None or (count == len(_JUELICH) and _are_whole(cells)):
        unit = "m" if any(_IN_M.search(line) for line in cells.comments) else "cm"
        named = _named(cells, dict(enumerate(_JUELICH[:count])))
        return named, _stating(wanted, fps=rate, unit=unit)
    if count == _N_MATRIX:
        rows = cells.frame.assign(frame=np.arange(len(cells.frame)))
        named = replace(_named(cells, _KITTI), frame=rows)
        named = replace(named, names=(*named.names, "frame"))
        return named, _stating(wanted, fps=_KITTI_FPS, unit="m")
    if count == len(_TUM) and _are_quaternions(cells):
        return _named(cells, dict(enumerate(_TUM))), _stating(wanted, time_unit="s", unit="m")
    if count == len(_ETH) and _are_whole(cells):
        frames = np.unique(_numbers(cells, 0))
        if (np.diff(frames[np.isfinite(frames)]) % _ETH_STEP == 0).all():
            return _named(cells, dict(enumerate(_ETH))), _stating(wanted, fps=_ETH_FPS, unit="m")
    return cells, wanted


def _stating(wanted: TableColumns, **stated: object) -> TableColumns:
    """Return the mapping with what the layout states, where the mapping states nothing.

    A rate of the layout gives way to a unit of times in the mapping, and the other way round.
    """
    if wanted.fps is not None:
        stated.pop("time_unit", None)
    given = {key: value for key, value in stated.items() if getattr(wanted, key) in (None, "")}
    return wanted.model_copy(update=given)


def _named(cells: Cells, names: dict[int, str]) -> Cells:
    given = tuple(names.get(column, name) for column, name in enumerate(cells.names))
    return replace(cells, names=given, has_names=True)


def _rate(cells: Cells) -> float | None:
    """Return the frame rate that a comment states."""
    found = _RATE.search("\n".join(cells.comments))
    rate = float(found[1]) if found else 0.0
    return rate if rate > 0.0 else None


def _with_stamps(cells: Cells) -> Cells:
    """Return the cells with the seconds and nanoseconds of stamps added in one column of times."""
    for column, name in enumerate(cells.names):
        match = _STAMP.fullmatch(name.strip().lower())
        rest = f"{name.strip()[: match.end(1)]}{_REST_NS[match[2]]}" if match else ""
        if rest in cells.names:
            frame, other = cells.frame.copy(), cells.names.index(rest)
            whole_s, rest_ns = (numeric(frame.iloc[:, each]) for each in (column, other))
            frame[frame.columns[column]] = whole_s + 1e-9 * rest_ns
            return replace(_named(cells, {column: "time [s]"}), frame=frame)
    return cells


def _numbers(cells: Cells, column: int) -> FloatArray:
    return numeric(cells.frame.iloc[:, column])


def _are_whole(cells: Cells) -> bool:
    """Whether the first two columns are whole numbers, as ids and frames are."""
    numbers = np.concatenate([_numbers(cells, 0), _numbers(cells, 1)])
    known = numbers[np.isfinite(numbers)]
    return bool((known == np.floor(known)).all())


def _are_quaternions(cells: Cells) -> bool:
    """Whether the last four columns are unit quaternions."""
    columns = np.stack([_numbers(cells, column) for column in range(4, 8)], axis=1)
    return bool(np.mean(np.abs(np.linalg.norm(columns, axis=1) - 1.0) < 0.02) > 0.9)
