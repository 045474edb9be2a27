"""Decisions (s, a, s') as a CSV table; numbers read back exactly."""

from pathlib import Path

from serd_core.demonstrations.decisions import Decisions
from serd_core.errors import SerdError
from storage.errors import FileError
from storage.table import Column, read_table, write_table

COLUMNS = (
    Column("episode", int),
    Column("time_s", float),
    Column("state", int),
    Column("action", int),
    Column("next_state", int),
    Column("source", str),
)
_NUMBERS = tuple(column.name for column in COLUMNS[:-1])


def save_decisions(path: str | Path, decisions: Decisions) -> None:
    """Write one line per decision below a line of column names."""
    numbers = [getattr(decisions, name).tolist() for name in _NUMBERS]
    rows = ((*row, decisions.source) for row in zip(*numbers, strict=True))
    write_table(path, COLUMNS, rows)


def load_decisions(path: str | Path) -> Decisions:
    """Read what `save_decisions` wrote; FileError names the line and the column of a fault."""
    table = read_table(path, COLUMNS)
    try:
        return Decisions(
            **{name: table[name].to_numpy() for name in _NUMBERS},
            source="; ".join(table["source"].unique()),
        )
    except SerdError as error:
        raise FileError(f"{path}: {error}") from None
