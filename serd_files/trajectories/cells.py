"""The cells of a table: text with commas, semicolons, tabs or spaces, or a file of a database.

Behind semicolons and tabs a comma is the decimal sign. Lines that begin with # are comments, of
which the last that names a time, x and y names the columns, unless the first line of values does.
Columns without a name are called by their number. Public layouts state more than their names:

| layout | recognised by | states |
| --- | --- | --- |
| ETH/UCY | 4 numbers: frame, id, x, y; frames in steps of 10 | 25 frames per second, m |
| Jülich archive | a comment `framerate: 25`, or 5 numbers: id, frame, x, y, z | rate, cm |
| TUM | timestamp tx ty tz qx qy qz qw, or 8 numbers with a unit quaternion | s, m |
| rostopic echo -p | %time, field.... | ns, m |
"""

import io
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from serd_bag.errors import FileError
from serd_bag.files import read_bytes
from serd_files.trajectories.columns import Cells, numeric, role_of
from serd_files.trajectories.databases import database_cells, is_of_database

if TYPE_CHECKING:
    import pandas as pd

_COMMENT = "#"
_ETH, _ETH_STEP = ("frame", "id", "x", "y"), 10
_JUELICH = ("id", "frame", "x", "y", "z")
_TUM = ("timestamp", "tx", "ty", "tz", "qx", "qy", "qz", "qw")
_IN_SI = {"time_unit": "s", "unit": "m"}
_IN_NS = {"time_unit": "ns", "unit": "m"}
#: What tables with these columns state.
_NAMED_LAYOUTS: tuple[tuple[tuple[str, ...], dict[str, Any]], ...] = (
    (_TUM, _IN_SI),
    (("%time",), _IN_NS),
)
_RATE = re.compile(r"frame\s*-?rate\D{0,5}(\d+(?:\.\d+)?)", re.IGNORECASE)
_IN_M = re.compile(r"\bin m\b")


def read_cells(path: Path) -> Cells:
    """Read the cells of a file; raises FileError if it holds no table."""
    if path.is_dir() or is_of_database(path):
        return database_cells(path)
    text = read_bytes(path).decode("utf-8-sig", errors="replace")
    if "\0" in text[:4096]:
        raise FileError(f"{path} must be a table of text, it is none; unpack it, or export as CSV")
    lines = [line.strip() for line in text.splitlines()]
    comments = [line.lstrip("# \t") for line in lines if line.startswith(_COMMENT)]
    rows = [line for line in lines if line and not line.startswith(_COMMENT)]
    if not rows:
        raise FileError(f"{path} must hold rows of values, it holds none; check the path")
    separator, decimal = _separator(rows[-1])
    names = _split(rows[0], separator)
    if _are_values(names, decimal):
        names = _named_in_comments(comments, separator)
    elif not (rows := rows[1:]):
        raise FileError(
            f"{path} must hold rows of values below the names of its columns, it holds none; check"
            " the path"
        )
    frame = _frame(path, rows, separator, decimal)
    if len(names) > frame.shape[1]:  # rows that are cut off
        frame = frame.reindex(columns=range(len(names)))
    numbers = map(str, range(len(names) + 1, frame.shape[1] + 1))
    cells = Cells(frame, (*names, *numbers))
    return _of_names(cells, comments) if names else _of_numbers(cells, comments)


def _frame(path: Path, rows: Sequence[str], separator: str, decimal: str) -> "pd.DataFrame":
    import pandas as pd

    try:
        return pd.read_csv(
            io.StringIO("\n".join(rows)),
            sep=r"\s+" if separator == " " else separator,
            decimal=decimal,
            header=None,
            skipinitialspace=True,
            low_memory=False,
        )
    except (ValueError, OverflowError) as error:  # pandas' parser errors are ValueErrors
        reason = str(error).splitlines()[0]
        raise FileError(f"{path} must be a table, but {reason}; export it again") from None


def _separator(line: str) -> tuple[str, str]:
    """Return the separator and the decimal sign."""
    for separator in (";", "\t"):
        if separator in line:
            return separator, "," if "," in line else "."
    return ("," if "," in line else " "), "."


def _split(line: str, separator: str) -> list[str]:
    cells = line.split() if separator == " " else line.split(separator)
    return [cell.strip().strip("\"'") for cell in cells]


def _are_values(cells: Sequence[str], decimal: str) -> bool:
    """Whether at least half of the cells are numbers; agents may have names."""
    n_numbers = sum(_is_number(cell.replace(decimal, ".")) for cell in cells)
    return 2 * n_numbers >= len(cells)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _named_in_comments(comments: Sequence[str], separator: str) -> list[str]:
    """Return the names in the last comment that has those of a time, x and y, or none."""
    for line in reversed(comments):
        for names in (_split(line, sign) for sign in (separator, " ", ",")):
            roles = {role_of(name) for name in names}
            if {"x", "y"} <= roles and not roles.isdisjoint(("time", "frame")):
                return names
    return []


def _rate(comments: Sequence[str]) -> float | None:
    """Return the frame rate that a comment states."""
    found = _RATE.search("\n".join(comments))
    rate = float(found[1]) if found else 0.0
    return rate if rate > 0.0 else None


def _of_names(cells: Cells, comments: Sequence[str]) -> Cells:
    """Return the cells with what their names and comments state."""
    for header, stated in _NAMED_LAYOUTS:
        if set(header) <= set(cells.names):
            return replace(cells, stated=stated)
    has_time = any(role_of(name) == "time" for name in cells.names)
    return replace(cells, stated={} if has_time else {"fps": _rate(comments)})


def _of_numbers(cells: Cells, comments: Sequence[str]) -> Cells:
    """Return the cells with the names of the layout that has rows of so many numbers."""
    count, rate = cells.frame.shape[1], _rate(comments)
    numbers = np.stack([numeric(cells.frame.iloc[:, at]) for at in range(min(count, 2))], axis=1)
    known = numbers[np.isfinite(numbers)]
    has_ids = bool((known == np.floor(known)).all())
    if rate is not None or (count == len(_JUELICH) and has_ids):
        unit = "m" if any(map(_IN_M.search, comments)) else "cm"
        names = (*_JUELICH[:count], *cells.names[len(_JUELICH) :])
        return replace(cells, names=names, stated={"fps": rate, "unit": unit})
    if count == len(_TUM):
        turns = np.stack([numeric(cells.frame.iloc[:, at]) for at in range(4, count)], axis=1)
        if np.mean(np.abs(np.linalg.norm(turns, axis=1) - 1.0) < 0.02) > 0.9:
            return replace(cells, names=_TUM, stated=_IN_SI)
    if count == len(_ETH) and has_ids:
        frames = np.unique(numbers[np.isfinite(numbers[:, 0]), 0])
        if (np.diff(frames) % _ETH_STEP == 0).all():
            return replace(cells, names=_ETH, stated={"fps": 25.0, "unit": "m"})
    return cells
