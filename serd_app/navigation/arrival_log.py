"""Predicted and measured arrivals, one CSV row per episode, appended as they come.

A row goes to the disk in one write and is synced, so that a killed process leaves whole rows; a
last row that a crash of the machine cut short is cut off before the next is appended.
"""

import csv
import io
import os
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from storage.errors import FileError, disk_error
from storage.text_file import read_text


@dataclass(frozen=True)
class ArrivalRow:
    """One drive, its prediction made at its start or at the last change of goal or model.

    outcome: arrived, timeout or aborted; reason: why it was given up, else empty.
    predicted_probability: of arriving in time; predicted_median_s, predicted_most_s: by which half
    and 90 % of such drives arrive, NaN where fewer ever do. time_of_arrival_s: NaN if it did not.
    predicted_share: predicted probability of arriving no later than it did; these are uniform on
    [0, 1] where predictions are right. All times are simulated seconds since the episode's start.
    """

    episode: int
    seed: int
    start_x_m: float
    start_y_m: float
    goal_x_m: float
    goal_y_m: float
    model: str
    outcome: str
    reason: str
    predicted_probability: float
    predicted_median_s: float
    predicted_most_s: float
    time_of_arrival_s: float
    predicted_share: float


_KINDS: dict[str, Callable[[str], Any]] = {"int": int, "float": float, "str": str}
_FIELDS = {field.name: _KINDS[getattr(field.type, "__name__", "")] for field in fields(ArrivalRow)}


def append_arrival(path: str | Path, row: ArrivalRow) -> None:
    """Append one row, below the column names in a new file; FileError where that cannot be."""
    path = Path(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("a+b") as stream:
            is_new = _cut_to_whole_rows(stream)
            stream.write(_text(row, with_names=is_new).encode())
            stream.flush()
            os.fsync(stream.fileno())
    except OSError as error:
        raise disk_error("write", path, error) from None


def load_arrivals(path: str | Path) -> tuple[ArrivalRow, ...]:
    """All whole rows; FileError names the line that is none.

    A file without a whole line, as it is while its first row is written, has none.
    """
    text = read_text(path)
    whole = text[: text.rfind("\n") + 1]
    if not whole:
        return ()
    reader = csv.DictReader(io.StringIO(whole))
    if tuple(reader.fieldnames or ()) != tuple(_FIELDS):
        raise FileError(
            f"{path}: must have the columns {', '.join(_FIELDS)}, got "
            f"{', '.join(reader.fieldnames or ()) or 'none'}; give a table of arrivals"
        )
    return tuple(_row(path, reader.line_num, row) for row in reader)


def _cut_to_whole_rows(stream: Any) -> bool:
    """Whether there is no row yet, after dropping what follows the last newline."""
    stream.seek(0)
    whole = stream.read()
    kept = whole.rfind(b"\n") + 1
    if kept < len(whole):
        stream.truncate(kept)
    return bool(kept == 0)


def _text(row: ArrivalRow, *, with_names: bool) -> str:
    stream = io.StringIO()
    writer = csv.DictWriter(stream, list(_FIELDS), lineterminator="\n")
    if with_names:
        writer.writeheader()
    writer.writerow(asdict(row))
    return stream.getvalue()


def _row(path: str | Path, line: int, row: dict[str, str]) -> ArrivalRow:
    try:
        return ArrivalRow(**{name: read(row[name]) for name, read in _FIELDS.items()})
    except (TypeError, ValueError) as error:
        raise FileError(f"{path}, line {line}: is no row of arrivals ({error}); mend it") from None
