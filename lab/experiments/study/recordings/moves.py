"""Decisions counted by what happened: how often action a led from s to s'.

A few hundred numbers, sufficient for every estimate of the dynamics.
"""

from collections.abc import Sequence

import numpy as np

from serd_core.demonstrations.decisions import Decisions

#: State, action, next state, how often.
Move = tuple[int, int, int, int]


def counted_moves(decisions: Decisions) -> list[Move]:
    """Every distinct (s, a, s') with its count, sorted."""
    table = np.stack([decisions.state, decisions.action, decisions.next_state], axis=1)
    distinct, counts = np.unique(table, axis=0, return_counts=True)
    return [tuple(row) for row in np.column_stack([distinct, counts]).tolist()]


def decisions_of_moves(moves: Sequence[Sequence[int]], source: str = "") -> Decisions:
    """Decisions with the counted moves; each an episode of its own."""
    columns = np.array(moves, dtype=np.int64).reshape(-1, 4)
    state, action, following = np.repeat(columns[:, :3], columns[:, 3], axis=0).T
    return Decisions(
        episode=np.arange(len(state)),
        time_s=np.zeros(len(state)),
        state=state,
        action=action,
        next_state=following,
        source=source,
    )
