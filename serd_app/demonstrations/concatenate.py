"""Decisions of several tables as one table."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from serd_app.errors import AppError
from serd_core.arrays import IntArray
from serd_core.demonstrations.decisions import Decisions

_LABEL = ", episodes"


def concatenate(tables: Sequence[Decisions]) -> Decisions:
    """All rows of several tables, one after the other; episodes keep their numbers."""
    return Decisions(
        episode=np.concatenate([table.episode for table in tables]),
        time_s=np.concatenate([table.time_s for table in tables]),
        state=np.concatenate([table.state for table in tables]),
        action=np.concatenate([table.action for table in tables]),
        next_state=np.concatenate([table.next_state for table in tables]),
        source="; ".join(dict.fromkeys(table.source for table in tables)),
    )


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
    source = _source([table.source for table in tables], episodes)
    return replace(concatenate(tables), episode=np.concatenate(episodes), source=source)


def _source(sources: Sequence[str], episodes: Sequence[IntArray]) -> str:
    if len(set(sources)) == 1:
        return sources[0]
    return "; ".join(map(_labelled, sources, episodes))


def _labelled(source: str, episodes: IntArray) -> str:
    if not len(episodes) or _LABEL in source:
        return source
    return f"{source}{_LABEL} {episodes.min()} to {episodes.max()}"
