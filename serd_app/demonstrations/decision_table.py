"""Decisions (s, a, s') as a CSV table that any spreadsheet reads; numbers survive exactly."""

import csv
import io
from collections.abc import Callable
from pathlib import Path

from serd_core.demonstrations.decisions import Decisions
from serd_core.errors import SerdError
from storage.atomic import atomic_write_text
from storage.errors import FileError
from storage.text_file import read_text

COLUMNS = ("episode", "time_s", "state", "action", "next_state", "source")
_READERS: tuple[Callable[[str], float], ...] = (int, float, int, int, int)


def save_decisions(path: str | Path, decisions: Decisions) -> None:
    """Write one line per decision below a line of column names."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    columns = (decisions.episode, decisions.time_s, decisions.state, decisions.action)
    numbers = [column.tolist() for column in (*columns, decisions.next_state)]
    writer.writerows((*row, decisions.source) for row in zip(*numbers, strict=True))
    atomic_write_text(path, text.getvalue())


def load_decisions(path: str | Path) -> Decisions:
    """Read what `save_decisions` wrote; FileError names the line and the column of a fault."""
    rows = list(csv.reader(read_text(path).splitlines()))
    if not rows or tuple(rows[0]) != COLUMNS:
        found = ",".join(rows[0])[:80] if rows else "an empty file"
        raise FileError(f"{path}: line 1 must be {','.join(COLUMNS)}, got {found}")
    numbers = [_numbers(path, line, row) for line, row in enumerate(rows[1:], start=2) if row]
    sources = list(dict.fromkeys(row[5] for row in rows[1:] if row))
    columns = list(zip(*numbers, strict=True)) or [()] * len(_READERS)
    try:
        return Decisions(
            **dict(zip(COLUMNS, columns, strict=False)),  # type: ignore[arg-type]
            source="; ".join(sources),
        )
    except SerdError as error:
        raise FileError(f"{path}: {error}") from None


def _numbers(path: str | Path, line: int, row: list[str]) -> list[float]:
    if len(row) != len(COLUMNS):
        raise FileError(f"{path}: line {line} must have {len(COLUMNS)} columns, got {len(row)}")
    return [
        _number(f"{path}: line {line}, {name}", read, text)
        for name, read, text in zip(COLUMNS, _READERS, row, strict=False)
    ]


def _number(where: str, read: Callable[[str], float], text: str) -> float:
    try:
        return read(text)
    except ValueError:
        kind = "a whole number" if read is int else "a number"
        raise FileError(f"{where} must be {kind}, got {text!r}") from None
