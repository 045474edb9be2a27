"""Rows in Parquet files, by pyarrow, which only those who want Parquet must install."""

from pathlib import Path
from typing import Any

from storage.errors import FileError, disk_error


def require_parquet() -> None:
    """FileError with the fix when pyarrow is not installed."""
    _pyarrow()


def parquet_bytes(rows: list[dict[str, Any]]) -> bytes:
    """The rows as a Parquet file; the type of a column follows from its values."""
    arrow = _pyarrow()
    stream = arrow.BufferOutputStream()
    arrow.parquet.write_table(arrow.Table.from_pylist(rows), stream)
    return bytes(stream.getvalue())


def read_parquet(path: Path) -> list[dict[str, Any]]:
    """Rows of a Parquet file; FileError when it cannot be read or is none."""
    arrow = _pyarrow()
    try:
        with path.open("rb") as file:
            rows: list[dict[str, Any]] = arrow.parquet.read_table(file).to_pylist()
    except OSError as error:
        raise disk_error("read", path, error) from None
    except arrow.ArrowException as error:
        reason = str(error).splitlines()[0]
        raise FileError(f"{path} must be a Parquet file, but {reason}; choose another") from None
    return rows


def _pyarrow() -> Any:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise FileError(
            "a .parquet table needs pyarrow, which is not installed"
            "; run 'pip install pyarrow' or name a .csv file"
        ) from None
    return pyarrow
