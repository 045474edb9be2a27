"""Entries of a transition model grouped by their distinct transition (s, a, s').

At walls several outcomes land in the same cell. Likelihoods and divergences are about the
transition, so they sum over all entries of its group and never guess one of them.
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray, IntArray, weighted_counts


@dataclass(frozen=True, eq=False)
class TransitionGroups:
    """G distinct transitions, sorted by row, then successor.

    group_of_entry: (E,); row, successor: (G,).
    """

    group_of_entry: IntArray
    row: IntArray
    successor: IntArray
    n_states: int

    def __len__(self) -> int:
        return len(self.row)

    def probabilities(self, entries: FloatArray) -> FloatArray:
        """(G,) probability of each distinct transition."""
        return weighted_counts(self.group_of_entry, entries, len(self))

    def find(self, row: IntArray, successor: IntArray) -> IntArray:
        """(N,) group of each transition asked for, -1 where the structure has none."""
        keys = self.row * self.n_states + self.successor
        wanted = np.asarray(row) * self.n_states + np.asarray(successor)
        place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        return np.where(keys[place] == wanted, place, -1)


def group_entries(row: IntArray, successor: IntArray, n_states: int) -> TransitionGroups:
    """Group entries by (row, successor)."""
    keys, group_of_entry = np.unique(row * n_states + successor, return_inverse=True)
    return TransitionGroups(
        group_of_entry=group_of_entry.reshape(-1),
        row=keys // n_states,
        successor=keys % n_states,
        n_states=n_states,
    )
