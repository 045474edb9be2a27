"""The Bellman equation of optimal control (Eqs. 2.24 to 2.26)."""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray, largest_per_row
from serd_core.bellman.equation import BellmanEquation


@dataclass(frozen=True)
class HardBellman(BellmanEquation):
    """Maximum over actions; a derivative is the greedy policy (a sub-derivative at ties)."""

    @property
    def curved(self) -> bool:
        """Piecewise linear."""
        return False

    def maximum(self, q: FloatArray) -> FloatArray:
        """(S,) max_a Q(s, a) (2.25)."""
        return largest_per_row(q)

    def policy(self, q: FloatArray) -> FloatArray:
        """(S, A) greedy policy (2.26), the first of equal actions."""
        greedy = np.zeros_like(q)
        greedy[np.arange(len(q)), q.argmax(axis=1)] = 1.0
        return greedy
