"""The cells of a table of any layout: separator, comments and names of columns are detected.

Text: values separated by commas, semicolons (then a comma may be the decimal sign), bars, tabs or
spaces, also compressed by gzip; lines that begin with #, % or // are comments, of which the last
that fits names the columns, unless the first line of values does, or one below a preamble. Parquet:
as its columns are named.
"""

import gzip
import io
import re
import zlib
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from serd_bag.errors import FileError
from serd_bag.files import read_bytes
from serd_files.trajectories.columns import role_of

if TYPE_CHECKING:
    import pandas as pd

PARQUET = (".parquet", ".pq")
_COMMENTS = ("#", "%", "//")
_RATE = re.compile(
    r"(?:frame\s*-?rate|fps|bildrate)\D{0,5}(\d+(?:\.\d+)?)|(\d+(?:\.\d+)?)\s*fps", re.I
)
_QUOTED_COMMA = re.compile(r'"[-+]?\d+,\d+"')
_DECIMAL_COMMA = re.compile(r"[-+]?\d+(?:,\d+)?")
_FEWEST_COLUMNS = 2
#: Fewest known roles in a line of names.
_FEWEST_ROLES = 3
_LONGEST_PREAMBLE = 100
_GZIP, _LARGEST_BYTES = b"\x1f\x8b", 2**30
_RATE_NAMES = ("fps", "frame_rate", "framerate")


@dataclass(frozen=True, eq=False)
class Cells:
    """names: of the columns, empty where the file has none; fps: frames per s that it states.

    n_skipped: rows with more cells than the first.
    """

    frame: "pd.DataFrame"
    names: tuple[str, ...] = ()
    fps: float | None = None
    comments: tuple[str, ...] = field(default=())
    n_skipped: int = 0


def read_cells(path: Path) -> Cells:
    """The cells of a file; FileError where it holds no table."""
    if path.suffix in PARQUET:
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
    """The content, decompressed where it is gzip."""
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
    comments = tuple(line for line in lines if line.startswith(_COMMENTS))
    rows = [line for line in lines if line and not line.startswith(_COMMENTS)]
    if not rows:
        raise FileError(f"{path} must hold rows of values, it holds none; check the path")
    separator, decimal = _separator(rows[-1])
    rows = rows[_preamble(rows, separator) :]
    names = _split(rows[0], separator)
    if _is_values(names, decimal):
        names = _named_in_comments(comments, separator, len(names))
    elif not (rows := rows[1:]):
        raise FileError(
            f"{path} must hold rows of values below the names of its columns, it holds none; check"
            " the path"
        )
    frame = _frame(path, rows, separator, decimal)
    if frame.shape[1] < _FEWEST_COLUMNS:
        raise FileError(
            f"{path} must have columns of time, x and y, got {frame.shape[1]} column; separate them"
            " by commas, semicolons, tabs or spaces"
        )
    if len(names) > frame.shape[1]:  # rows that are cut off
        frame = frame.reindex(columns=range(len(names)))
    elif names:  # further columns have their numbers
        names += map(str, range(len(names) + 1, frame.shape[1] + 1))
    rate = _rate(comments) or _rate_in_rows(frame, names)
    return Cells(frame, tuple(names), rate, comments, len(rows) - len(frame))


def _preamble(rows: Sequence[str], separator: str) -> int:
    """How many lines precede the line of names."""
    n_roles = [len(_roles(_split(row, separator))) for row in rows[:_LONGEST_PREAMBLE]]
    if n_roles[0] >= _FEWEST_ROLES or max(n_roles) < _FEWEST_ROLES:
        return 0
    return n_roles.index(max(n_roles))


def _roles(names: Sequence[str]) -> set[str]:
    return {role for name in names if (role := role_of(name))}


def _rate_in_rows(frame: "pd.DataFrame", names: Sequence[str]) -> float | None:
    """The rate in a column of rates, where all rows have the same."""
    columns = [row for row, name in enumerate(names) if name.strip().lower() in _RATE_NAMES]
    rates = set(frame.iloc[:, columns[0]].dropna()) if columns else set()
    rate = rates.pop() if len(rates) == 1 else None
    return float(rate) if isinstance(rate, int | float) and rate > 0 else None


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
    """(separator, decimal sign)."""
    for each in (";", "\t", "|"):
        if each in line:
            return each, "," if "," in line else "."
    if "," not in line:
        return " ", "."
    if _QUOTED_COMMA.search(line):
        return ",", ","
    cells = line.split()
    if len(cells) > _FEWEST_COLUMNS and all(map(_DECIMAL_COMMA.fullmatch, cells)):
        return " ", ","
    return ",", "."


def _split(line: str, separator: str) -> list[str]:
    cells = line.split() if separator == " " else line.split(separator)
    return [cell.strip().strip("\"'") for cell in cells]


def _is_values(cells: Sequence[str], decimal: str) -> bool:
    """Whether most of the cells are numbers; agents may have names."""
    n_numbers = sum(_is_number(cell.replace(decimal, ".")) for cell in cells)
    return 2 * n_numbers >= len(cells)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _named_in_comments(comments: Sequence[str], separator: str, count: int) -> list[str]:
    """Names of the columns from the comments without numbers, cut to `count`; empty without any.

    Preferred, each time the last: as many names as columns, one of a known role; three known roles;
    as many names as columns.
    """
    texts = [line.lstrip("#%/ \t") for line in reversed(comments)]
    found = [_split(text, each) for text in texts for each in (separator, " ", ",")]
    found = [names for names in found if not any(map(_is_number, names))]
    roles = [len(_roles(names)) for names in found]
    as_many = [len(names) == count >= _FEWEST_COLUMNS for names in found]
    for fits in (
        [same and n > 0 for same, n in zip(as_many, roles, strict=True)],
        [n >= _FEWEST_ROLES for n in roles],
        as_many,
    ):
        if any(fits):
            return found[fits.index(True)][:count]
    return []


def _rate(comments: Sequence[str]) -> float | None:
    found = _RATE.search("\n".join(comments))
    rate = float(found[1] or found[2]) if found else 0.0
    return rate if rate > 0.0 else None
