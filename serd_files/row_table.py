"""A growing table of rows by key, as CSV or Parquet; every row is on disk at once.

CSV is appended to line by line. A Parquet file cannot be: its new rows wait in a CSV file beside it
until the table is closed, and are found there by the next run if this one was killed.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from serd_bag.errors import FileError
from serd_files.table import (
    Column,
    append_row,
    cell_text,
    is_parquet,
    read_table,
    records,
    remove_partial_line,
    write_table,
)

#: One line of a table; None where a value is missing.
Row = dict[str, Any]
Key = tuple[str, ...]


class RowTable:
    """Rows by key, the text of their `key_columns`; use it in a `with` block."""

    def __init__(
        self, path: str | Path, columns: Sequence[Column], key_columns: Sequence[str]
    ) -> None:
        self.path = Path(path)
        if self.path.suffix.lower() not in (".csv", ".parquet"):
            raise FileError(
                f"a table must end in .csv or .parquet, got {self.path}; rename it to "
                f"{self.path.stem or 'table'}.csv"
            )
        self.rows: dict[Key, Row] = {}
        self._columns, self._key_columns = tuple(columns), tuple(key_columns)
        self._lines = new_rows_path(self.path) if is_parquet(self.path) else self.path
        for file in dict.fromkeys((self.path, self._lines)):
            if file.exists():
                self._read(file)

    def append(self, row: Row) -> None:
        """Write one row; FileError where it has other columns than the table."""
        names = [column.name for column in self._columns]
        if differing := sorted(set(row) ^ set(names)):
            raise FileError(
                f"{self.path} must have the columns of every row, but {differing[0]!r} is in one "
                "only; choose another file"
            )
        append_row(self._lines, self._columns, [row[name] for name in names])
        self.rows[self._key(row)] = row

    def close(self) -> None:
        """Move the rows that wait beside a Parquet file into it."""
        if self._lines != self.path and self._lines.exists():
            names = [column.name for column in self._columns]
            rows = [[row[name] for name in names] for row in self.rows.values()]
            write_table(self.path, self._columns, rows)
            self._lines.unlink()

    def __enter__(self) -> "RowTable":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _key(self, row: Row) -> Key:
        return tuple(cell_text(row[name]) for name in self._key_columns)

    def _read(self, file: Path) -> None:
        """Read the rows, and remove a last line that a crash cut short."""
        growing = file == self._lines
        rows = records(read_table(file, self._columns, growing=growing))
        if growing:
            remove_partial_line(file)
        self.rows |= {self._key(row): row for row in rows}


def new_rows_path(path: Path) -> Path:
    """Where the rows wait that are not yet in a Parquet file."""
    return path.with_name(f"{path.name}.new_rows.csv")
