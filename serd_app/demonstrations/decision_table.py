"""Decisions (s, a, s', dwell time) as a CSV table, and several as one."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from serd_app.errors import AppError
from serd_bag.errors import FileError
from serd_core.demonstrations.decisions import TIMED_COLUMNS, TimedDecisions
from serd_core.errors import SerdError
from serd_files.table import Column, read_table, write_table

COLUMNS = (
    Column("episode", int),
    Column("time_s", float),
    Column("state", int),
    Column("action", int),
    Column("next_state", int),
    Column("dwell_s", float),
    Column("censored", int),
    Column("source", str),
)
_LABEL = ", episodes"


def save_decisions(path: str | Path, decisions: TimedDecisions) -> None:
    """Write one line per decision below a line of column names; censored: 0 or 1."""
    numbers = [getattr(decisions, each.name).astype(each.kind).tolist() for each in COLUMNS[:-1]]
    rows = ((*row, decisions.source) for row in zip(*numbers, strict=True))
    write_table(path, COLUMNS, rows)


def load_decisions(path: str | Path) -> TimedDecisions:
    """Read what `save_decisions` wrote; FileError names the line and the column of a fault."""
    rows = read_table(path, COLUMNS)
    try:
        return TimedDecisions(
            **{
                each.name: np.array([row[each.name] for row in rows], dtype=each.kind)
                for each in COLUMNS[:-1]
            },
            source="; ".join(dict.fromkeys(row["source"] for row in rows)),
        )
    except SerdError as error:
        raise FileError(f"{path}: {error}") from None


def concatenate(tables: Sequence[TimedDecisions]) -> TimedDecisions:
    """All rows of several tables, one after the other; episodes keep their numbers."""
    columns = {
        name: np.concatenate([getattr(each, name) for each in tables]) for name in TIMED_COLUMNS
    }
    sources = dict.fromkeys(each.source for each in tables)
    return TimedDecisions(**columns, source="; ".join(sources))


def concatenate_renumbered(tables: Sequence[TimedDecisions]) -> TimedDecisions:
    """All rows in the order given; episodes of later tables are numbered on from the last.

    Episodes keep their numbers in the first table; within each table their order is kept. Where
    the sources differ, the source of the result names the episodes of each.
    """
    if not tables:
        raise AppError("tables must hold at least one table of decisions, got none")
    episodes, following = [], 0
    for table in tables:
        shift = max(0, following - int(table.episode.min(initial=following)))
        episodes.append(table.episode + shift)
        following = max(following, int(episodes[-1].max(initial=-1)) + 1)
    found = replace(concatenate(tables), episode=np.concatenate(episodes))
    sources = [table.source for table in tables]
    if len(set(sources)) == 1:
        return found
    for row, numbers in enumerate(episodes):
        if len(numbers) and _LABEL not in sources[row]:
            sources[row] += f"{_LABEL} {numbers.min()} to {numbers.max()}"
    return replace(found, source="; ".join(sources))
