"""Decisions of several recordings as one table."""

from collections.abc import Sequence

import numpy as np

from bags.errors import BagError
from serd_core.arrays import IntArray
from serd_core.demonstrations.decisions import Decisions

_LABEL = ", episodes"


def joined_decisions(tables: Sequence[Decisions]) -> Decisions:
    """All decisions, in the order given; episodes of later tables are numbered on from the last.

    Episodes keep their numbers in the first table; within each table their order is kept. Where
    the sources differ, the joined one says which episodes are from which.
    """
    if not tables:
        raise BagError("tables must hold at least one table of decisions, got none")
    episodes, following = [], 0
    for table in tables:
        shift = max(0, following - int(table.episode.min(initial=following)))
        episodes.append(table.episode + shift)
        following = max(following, int(episodes[-1].max(initial=-1)) + 1)
    return Decisions(
        episode=np.concatenate(episodes),
        time_s=np.concatenate([table.time_s for table in tables]),
        state=np.concatenate([table.state for table in tables]),
        action=np.concatenate([table.action for table in tables]),
        next_state=np.concatenate([table.next_state for table in tables]),
        source=_source([table.source for table in tables], episodes),
    )


def _source(sources: Sequence[str], episodes: Sequence[IntArray]) -> str:
    if len(set(sources)) == 1:
        return sources[0]
    return "; ".join(map(_labelled, sources, episodes))


def _labelled(source: str, episodes: IntArray) -> str:
    if not len(episodes) or _LABEL in source:
        return source
    return f"{source}{_LABEL} {episodes.min()} to {episodes.max()}"
