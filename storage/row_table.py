"""A growing table of rows, as CSV or Parquet by the file's suffix; every row is on disk at once.

CSV is appended to line by line. A Parquet file cannot be: its new rows wait in a CSV file beside it
until the table is closed, and are found there by the next run if this one was killed.
"""

import csv
import io
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from storage.atomic import atomic_write_bytes, atomic_write_text
from storage.errors import FileError, disk_error
from storage.parquet import parquet_bytes, read_parquet, require_parquet
from storage.text_file import read_text

#: One line of a table; None where a value is missing.
Row = dict[str, Any]
Key = tuple[str, ...]

SUFFIXES = (".csv", ".parquet")


class RowTable:
    """Rows by key, the text of their `key_columns`; use it in a `with` block."""

    def __init__(self, path: str | Path, key_columns: Sequence[str]) -> None:
        self.path = Path(path)
        self._key_columns = tuple(key_columns)
        self._columns: list[str] | None = None
        self.rows: dict[Key, Row] = {}
        suffix = self.path.suffix.lower()
        if suffix not in SUFFIXES:
            raise FileError(
                f"a table must end in .csv or .parquet, got {self.path}; rename it to "
                f"{self.path.stem or 'table'}.csv"
            )
        self._is_parquet = suffix == ".parquet"
        self._lines = waiting_lines(self.path) if self._is_parquet else self.path
        if self._is_parquet:
            require_parquet()
            if self.path.exists():
                self._take(read_parquet(self.path), self.path)
        if self._lines.exists():
            self._take(self._read_lines(), self._lines)

    def append(self, row: Row) -> None:
        """Write one row; FileError where it has other columns than those before it."""
        if self._columns is None:
            self._columns = list(row)
        elif set(row) != set(self._columns):
            differing = sorted(set(row) ^ set(self._columns))
            raise FileError(
                f"{self.path} must have the columns of every row, but {differing[0]!r} is in one "
                "only; choose another file"
            )
        self._write_line(row)
        self.rows[self._key(row)] = row

    def close(self) -> None:
        """Bring what waits beside a Parquet file into it."""
        if self._is_parquet and self._lines.exists():
            atomic_write_bytes(self.path, parquet_bytes(list(self.rows.values())))
            self._lines.unlink()

    def __enter__(self) -> "RowTable":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _key(self, row: Row) -> Key:
        return tuple(as_text(row[name]) for name in self._key_columns)

    def _write_line(self, row: Row) -> None:
        assert self._columns is not None
        try:
            self._lines.parent.mkdir(parents=True, exist_ok=True)
            with self._lines.open("a", newline="", encoding="utf-8") as file:
                writer = csv.DictWriter(file, self._columns, lineterminator="\n")
                if file.tell() == 0:
                    writer.writeheader()
                writer.writerow({name: as_text(value) for name, value in row.items()})
        except OSError as error:
            raise disk_error("write", self._lines, error) from None

    def _take(self, rows: list[Row], source: Path) -> None:
        for row in rows:
            self._require_key(list(row), source)
            self._columns = list(row)
            self.rows[self._key(row)] = row

    def _require_key(self, columns: Sequence[str], source: Path) -> None:
        missing = [name for name in self._key_columns if name not in columns]
        if missing:
            raise FileError(
                f"{source} must be a table of {', '.join(self._key_columns)}, but has no "
                f"column {missing[0]!r}; choose another file"
            )

    def _read_lines(self) -> list[Row]:
        """Whole lines; one that a crash cut short is dropped, from the file too.

        Nothing is touched of a file whose first line is not a table's header.
        """
        text = read_text(self._lines)
        whole = text[: text.rfind("\n") + 1]
        reader = csv.DictReader(io.StringIO(whole))
        if text:
            self._columns = list(reader.fieldnames or ())
            self._require_key(self._columns, self._lines)
        if whole != text:
            atomic_write_text(self._lines, whole)
        return [{name: _value(each) for name, each in row.items()} for row in reader]


def waiting_lines(path: Path) -> Path:
    """Where the rows wait that are not yet in a Parquet file."""
    return path.with_name(f"{path.name}.new_rows.csv")


def as_text(value: object) -> str:
    """A value as it stands in CSV: nothing for None, floats so that they read back exactly."""
    return "" if value is None else str(value)


def _value(text: str) -> Any:
    """A number as a number, an empty field as None."""
    if text == "":
        return None
    for kind in (int, float):
        with suppress(ValueError):
            return kind(text)
    return text
