"""The cells of a table: text with commas, semicolons, tabs or spaces, gzip of it, or Parquet.

Behind semicolons and tabs a comma is the decimal sign. Lines that begin with # are comments, of
which the last that names a time, x and y names the columns, unless the first line of values does.
Columns without a name are called by their number.
"""

import gzip
import io
import zlib
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from serd_bag.errors import FileError
from serd_bag.files import read_bytes
from serd_files.trajectories.columns import role_of

if TYPE_CHECKING:
    import pandas as pd

_PARQUET = (".parquet", ".pq")
_COMMENT = "#"
_GZIP, _LARGEST_BYTES = b"\x1f\x8b", 2**30


@dataclass(frozen=True, eq=False)
class Cells:
    """names: of all columns; has_names: whether the file names them; n_skipped: rows with more
    cells than the first."""

    frame: "pd.DataFrame"
    names: tuple[str, ...]
    has_names: bool = True
    comments: tuple[str, ...] = ()
    n_skipped: int = 0


def read_cells(path: Path) -> Cells:
    """Read the cells of a file; raises FileError if it holds no table."""
    if path.suffix in _PARQUET:
        return _parquet(path)
    content = _unpacked(path, read_bytes(path))
    encoding = "utf-16" if content.startswith((BOM_UTF16_LE, BOM_UTF16_BE)) else "utf-8-sig"
    text = content.decode(encoding, errors="replace")
    if "\0" in text[:4096]:
        raise FileError(
            f"{path} must be a table of text or Parquet, it is neither; unpack archives, else check"
            " the path"
        )
    return _text(path, text)


def _unpacked(path: Path, content: bytes) -> bytes:
    """Return the content, decompressed where it is gzip."""
    if not content.startswith(_GZIP):
        return content
    try:
        unpacked = gzip.GzipFile(fileobj=io.BytesIO(content)).read(_LARGEST_BYTES + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise FileError(f"{path} must be a file of gzip, but {error}; compress it again") from None
    if len(unpacked) > _LARGEST_BYTES:
        raise FileError(f"{path} must hold at most 1 GB of text; divide it, or write Parquet")
    return unpacked


def _parquet(path: Path) -> Cells:
    import pandas as pd

    content = io.BytesIO(read_bytes(path))
    try:
        frame = pd.read_parquet(content)
    except ImportError:
        raise FileError(f"{path} needs pyarrow; install it: pip install pyarrow") from None
    except Exception as error:  # pyarrow raises errors of any kind for foreign bytes
        reason = str(error).splitlines()[0]
        raise FileError(f"{path} must be a Parquet file, but {reason}; write it again") from None
    if frame.index.names != [None] and set(frame.index.names).isdisjoint(frame.columns):
        frame = frame.reset_index()
    return Cells(frame, tuple(map(str, frame.columns)))


def _text(path: Path, text: str) -> Cells:
    lines = [line.strip() for line in text.splitlines()]
    comments = tuple(line.lstrip("# \t") for line in lines if line.startswith(_COMMENT))
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
    return Cells(frame, (*names, *numbers), bool(names), comments, len(rows) - len(frame))


def _frame(path: Path, rows: Sequence[str], separator: str, decimal: str) -> "pd.DataFrame":
    import pandas as pd

    try:
        return pd.read_csv(
            io.StringIO("\n".join(rows)),
            sep=r"\s+" if separator == " " else separator,
            decimal=decimal,
            header=None,
            skipinitialspace=True,
            on_bad_lines="skip",
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
        for names in (_split(line, each) for each in (separator, " ", ",")):
            roles = {role_of(name) for name in names}
            if {"x", "y"} <= roles and not roles.isdisjoint(("time", "frame")):
                return names
    return []
