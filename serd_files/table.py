"""Typed tables in CSV files: columns described once, read as rows of plain values.

Columns carry their units in their names (`_s`, `_m`, `_mps`), and floats read back exactly. A
growing table gets one synced write per row, a whole table is replaced atomically.
"""

import csv
import io
import math
import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, BinaryIO, TypeVar, get_args, get_type_hints

from serd_bag.errors import FileError, disk_errors, shortened
from serd_bag.files import atomic_write_text, read_text

#: One line of a table; None where a value is missing.
Row = dict[str, Any]
Key = tuple[str, ...]
#: A float that is NaN where it does not apply.
OptionalFloat = Annotated[float, "NaN allowed"]
RowClass = TypeVar("RowClass")
#: Characters that CSV does not keep.
_LOST_IN_CSV = frozenset("\r\0")
_INT64 = range(-(2**63), 2**63)


@dataclass(frozen=True)
class Column:
    """One column of int, float or str cells.

    nullable: whether an int cell may be empty (None) and a float cell NaN.
    """

    name: str
    kind: type[int] | type[float] | type[str]
    nullable: bool = False


def columns_of(row_class: type[Any]) -> tuple[Column, ...]:
    """The columns of a table whose rows are instances of a dataclass, in the order of its fields.

    `int | None` and `OptionalFloat` are nullable.
    """
    hints = get_type_hints(row_class, include_extras=True)
    found = []
    for name in (field.name for field in fields(row_class)):
        kinds = get_args(hints[name]) or (hints[name],)
        nullable = NoneType in kinds or hints[name] == OptionalFloat
        found.append(Column(name, kinds[0], nullable))
    return tuple(found)


def cell_text(value: object) -> str:
    """A value as it stands in CSV: nothing for None, floats by repr."""
    return "" if value is None else str(value)


def csv_text(header: Sequence[object], rows: Iterable[Sequence[object]]) -> str:
    """A header and one line per row; None is an empty cell, floats are written by repr."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return text.getvalue()


def write_table(
    path: str | Path, columns: Sequence[Column], rows: Iterable[Sequence[object]]
) -> None:
    """Replace the file; values in the order of the columns.

    FileError for a row that `read_table` would reject.
    """
    lines = [_writable(path, line, columns, row) for line, row in enumerate(rows, start=2)]
    atomic_write_text(path, csv_text(_names(columns), lines))


def append_row(path: str | Path, columns: Sequence[Column], row: Sequence[object]) -> None:
    """Append one synced line to a CSV file, below the header in a new file.

    A last line that a crash cut short is removed first. FileError for a row that `read_table` would
    reject.
    """
    path = Path(path)
    row = _writable(path, "to append", columns, row)
    with disk_errors("write", path):
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("a+b") as stream:
            is_new = _truncate_to_whole_lines(stream)
            header, line = (csv_text(part, ()) for part in (_names(columns), row))
            stream.write((header + line if is_new else line).encode())
            stream.flush()
            os.fsync(stream.fileno())


def read_table(
    path: str | Path,
    columns: Sequence[Column],
    *,
    growing: bool = False,
    fix: str = "choose another file",
) -> list[Row]:
    """The rows of the table; FileError names the line, the column and the value of a fault.

    An empty cell is None in a nullable int column and NaN in a nullable float column.
    growing: whether a last line without its end is left out, because it is being written. fix: what
    to do about a table with other columns.
    """
    lines = _csv_lines(path, columns, growing=growing)
    _, header = next(lines, (1, []))
    names = _names(columns)
    if header != names:
        raise FileError(f"{path}: {_header_fault(header, names)}; {fix}")
    missing = [math.nan if each.kind is float else None for each in columns]
    return [
        {
            name: absent if value is None else value
            for name, value, absent in zip(
                names, _checked_row(path, line, columns, cells), missing, strict=True
            )
        }
        for line, cells in lines
    ]


def write_rows(path: str | Path, row_class: type[Any], rows: Iterable[Any]) -> None:
    """Replace the file by the instances of a dataclass with a field for each column."""
    write_table(path, columns_of(row_class), map(astuple, rows))


def read_rows(path: str | Path, row_class: type[RowClass]) -> tuple[RowClass, ...]:
    """The table as instances of a dataclass."""
    return tuple(row_class(**row) for row in read_table(path, columns_of(row_class)))


class RowTable:
    """Rows by key, the text of their `key_columns`; every row is on disk at once.

    A last line that a crash cut short is removed when the file is opened.
    """

    def __init__(
        self, path: str | Path, columns: Sequence[Column], key_columns: Sequence[str]
    ) -> None:
        self.path = Path(path)
        if self.path.suffix.lower() != ".csv":
            raise FileError(
                f"a table must end in .csv, got {self.path}; rename it to "
                f"{self.path.stem or 'table'}.csv"
            )
        self.rows: dict[Key, Row] = {}
        self._columns, self._key_columns = tuple(columns), tuple(key_columns)
        if self.path.exists():
            rows = read_table(self.path, self._columns, growing=True)
            self.rows = {self._key(row): row for row in rows}
            with disk_errors("write", self.path), self.path.open("r+b") as stream:
                _truncate_to_whole_lines(stream)

    def append(self, row: Row) -> None:
        """Write one row; FileError where it has other columns than the table."""
        names = _names(self._columns)
        if differing := sorted(set(row) ^ set(names)):
            raise FileError(
                f"{self.path} must have the columns of every row, but {differing[0]!r} is in one "
                "only; choose another file"
            )
        append_row(self.path, self._columns, [row[name] for name in names])
        self.rows[self._key(row)] = row

    def _key(self, row: Row) -> Key:
        return tuple(cell_text(row[name]) for name in self._key_columns)


@dataclass(frozen=True)
class EpisodeResult:
    """How one episode ended; times in simulated seconds.

    time_of_arrival_s: NaN if the robot did not arrive; minimum_person_distance_m: NaN if not
    measured. wall_s: wall time from the first to the last
    observation, for the real-time factor. reason: why the driver gave up, empty otherwise.
    """

    episode: int
    seed: int
    driver: str
    start_area: str
    outcome: str
    time_of_arrival_s: OptionalFloat
    duration_s: float
    distance_m: float
    robot_on_person: int
    person_on_robot: int
    robot_on_wall: int
    minimum_person_distance_m: OptionalFloat
    wall_s: float
    reason: str = ""

    @property
    def arrived(self) -> bool:
        """Whether the robot reached the goal area in time."""
        return self.outcome == "arrived"


def load_episodes(path: str | Path) -> tuple[EpisodeResult, ...]:
    """All rows of a table; FileError names the line of a fault."""
    episodes = read_rows(path, EpisodeResult)
    for line, each in enumerate(episodes, start=2):
        time_s = each.time_of_arrival_s
        if not (0.0 <= time_s < math.inf if each.arrived else math.isnan(time_s)):
            raise FileError(
                f"{path}: line {line}, time_of_arrival_s must be finite and not negative if outcome"
                f" is 'arrived', else nan, got {time_s} and {each.outcome!r}; correct the line"
            )
    return episodes


def _names(columns: Iterable[Column]) -> list[str]:
    return [column.name for column in columns]


def _header_fault(header: list[str], known: list[str]) -> str:
    missing = [name for name in known if name not in header]
    detail = f"has no column {missing[0]!r}" if missing else "has others, or in another order"
    return (
        f"must have the columns {shortened(', '.join(known))}, got"
        f" {shortened(', '.join(header)) or 'none'}; it {detail}"
    )


def _truncate_to_whole_lines(stream: BinaryIO) -> bool:
    """Remove what follows the last line end; whether nothing is left."""
    end = stream.seek(0, os.SEEK_END)
    if end:
        stream.seek(end - 1)
        if stream.read(1) != b"\n":
            stream.seek(0)
            end = stream.read().rfind(b"\n") + 1
            stream.truncate(end)
    return end == 0


def _csv_lines(
    path: str | Path, columns: Sequence[Column], *, growing: bool
) -> Iterator[tuple[int, list[str]]]:
    text = read_text(path)
    if growing:  # without a partial last line, or with the header where only a part of it is there
        header = csv_text(_names(columns), ())
        text = header if header.startswith(text) else text[: text.rfind("\n") + 1] or text
    reader = csv.reader(io.StringIO(text), strict=True)
    try:
        for cells in reader:
            if cells:
                yield reader.line_num, cells
    except csv.Error as error:
        raise FileError(
            f"{path}: line {reader.line_num} must be CSV, but {error}; correct the line"
        ) from None


def _writable(
    path: Path | str, line: int | str, columns: Sequence[Column], row: Sequence[object]
) -> list[Any]:
    """The row as it is read back."""
    cells = [cell_text(value) for value in row]
    for column, cell in zip(columns, cells, strict=False):
        if column.kind is str and not _LOST_IN_CSV.isdisjoint(cell):
            raise FileError(
                f"{path}: line {line}, {column.name} must hold no carriage return and no NUL, got"
                f" {shortened(repr(cell))}; correct the value"
            )
    return _checked_row(path, line, columns, cells)


def _checked_row(
    path: str | Path, line: int | str, columns: Sequence[Column], cells: Sequence[str]
) -> list[Any]:
    if len(cells) != len(columns):
        raise FileError(
            f"{path}: line {line} must have {len(columns)} columns, got {len(cells)}"
            "; correct the line"
        )
    place = f"{path}: line {line}"
    return [_value(place, column, cell) for column, cell in zip(columns, cells, strict=True)]


def _value(place: str, column: Column, cell: str) -> int | float | str | None:
    """The cell as a value of the column."""
    if column.kind is str:
        return cell
    if column.nullable and cell == "":
        return None
    with suppress(ValueError):
        value = column.kind(cell)
        if isinstance(value, int) and value in _INT64:
            return value
        if isinstance(value, float) and (column.nullable or not math.isnan(value)):
            return value
    rule = "a whole number" if column.kind is int else "a number"
    raise FileError(
        f"{place}, {column.name} must be {rule}, got {shortened(repr(cell))}; correct the line"
    )
