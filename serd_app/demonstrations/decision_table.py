"""Decisions (s, a, s') as a CSV table, whose numbers read back exactly; several tables as one."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from serd_app.errors import AppError
from serd_bag.errors import FileError
from serd_core.arrays import IntArray
from serd_core.demonstrations.decisions import Decisions
from serd_core.errors import SerdError
from serd_files.table import Column, read_table, write_table

COLUMNS = (
    Column("episode", int),
    Column("time_s", float),
    Column("state", int),
    Column("action", int),
    Column("next_state", int),
    Column("source", str),
)
_LABEL = ", episodes"
_NUMBERS = tuple(column.name for column in COLUMNS[:-1])


def save_decisions(path: str | Path, decisions: Decisions) -> None:
    """Write one line per decision below a line of column names."""
    numbers = [getattr(decisions, name).tolist() for name in _NUMBERS]
    rows = ((*row, decisions.source) for row in zip(*numbers, strict=True))
    write_table(path, COLUMNS, rows)


def load_decisions(path: str | Path) -> Decisions:
    """Read what `save_decisions` wrote; FileError names the line and the column of a fault."""
    rows = read_table(path, COLUMNS)
    try:
        return Decisions(
            **{
                each.name: np.array([row[each.name] for row in rows], dtype=each.kind)
                for each in COLUMNS[:-1]
            },
            source="; ".join(dict.fromkeys(row["source"] for row in rows)),
        )
    except SerdError as error:
        raise FileError(f"{path}: {error}") from None


def concatenate(tables: Sequence[Decisions]) -> Decisions:
    """All rows of several tables, one after the other; episodes keep their numbers."""
    numbers = {name: np.concatenate([getattr(each, name) for each in tables]) for name in _NUMBERS}
    return Decisions(**numbers, source="; ".join(dict.fromkeys(each.source for each in tables)))


def concatenate_renumbered(tables: Sequence[Decisions]) -> Decisions:
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
    return replace(found, source="; ".join(map(_labelled, sources, episodes)))


def _labelled(source: str, episodes: IntArray) -> str:
    if not len(episodes) or _LABEL in source:
        return source
    return f"{source}{_LABEL} {episodes.min()} to {episodes.max()}"
