"""Decisions from columns of a table, and from episodes as sequences of states and actions."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from serd_core.arrays import int_array, shown
from serd_core.demonstrations.decisions import COLUMNS, Decisions
from serd_core.errors import SerdError


def decisions_from_columns(table: Any, source: str = "") -> Decisions:
    """Decisions of a mapping, data frame or structured array with the columns of `Decisions`."""
    try:
        columns = [np.asarray(table[name]) for name in COLUMNS]
    except (KeyError, ValueError, IndexError, TypeError) as error:
        raise SerdError(
            f"table must have the columns {', '.join(COLUMNS)}, got an error for one: {error};"
            " rename it"
        ) from error
    return Decisions(**dict(zip(COLUMNS, columns, strict=True)), source=source)


def decisions_from_episodes(
    episodes: Iterable[tuple[Sequence[int], Sequence[int]]], source: str = ""
) -> Decisions:
    """Decisions of (states, actions) per episode, with one more state than actions."""
    rows = []
    for number, episode in enumerate(episodes):
        try:
            states, actions = episode
        except (TypeError, ValueError) as error:
            raise SerdError(
                f"episode {number} must be a pair (states, actions), got {shown(episode)}; leave"
                " out anything else"
            ) from error
        visited = int_array(f"states of episode {number}", states, (None,))
        chosen = int_array(f"actions of episode {number}", actions, (None,))
        if len(visited) != len(chosen) + 1:
            raise SerdError(
                f"episode {number} must have one more state than actions, got {len(visited)} and"
                f" {len(chosen)}; add the state after the last action"
            )
        step = np.arange(len(chosen))
        rows.append((np.full(len(chosen), number), step, visited[:-1], chosen, visited[1:]))
    if not rows:
        raise SerdError("episodes must hold at least one episode, got none; record an episode")
    columns = [np.concatenate(column) for column in zip(*rows, strict=True)]
    return Decisions(**dict(zip(COLUMNS, columns, strict=True)), source=source)
