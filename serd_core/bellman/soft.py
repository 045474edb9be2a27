"""The soft Bellman equation of maximum discounted causal entropy (Eqs. 3.28 to 3.30).

V(s) = log sum_a exp Q(s, a),  pi(a | s) = exp(Q(s, a) - V(s)). The temperature is 1.
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray, largest_per_row, sum_per_row
from serd_core.bellman.equation import BellmanEquation


@dataclass(frozen=True)
class SoftBellman(BellmanEquation):
    """Log-sum-exp over actions; its derivative is the Boltzmann policy."""

    @property
    def curved(self) -> bool:
        """Smooth."""
        return True

    def maximum(self, q: FloatArray) -> FloatArray:
        """(S,) log sum_a exp Q(s, a) (3.29)."""
        highest = largest_per_row(q)
        shifted = np.exp(q - highest[:, None])
        return np.asarray(highest + np.log(sum_per_row(shifted)))

    def policy(self, q: FloatArray) -> FloatArray:
        """(S, A) Boltzmann distribution over Q (3.30)."""
        return boltzmann(q, 1.0)


def boltzmann(q: FloatArray, temperature: float) -> FloatArray:
    """(S, A) probabilities proportional to exp(Q(s, a) / temperature) (4.62)."""
    shifted = np.exp((q - largest_per_row(q)[:, None]) / temperature)
    return np.asarray(shifted / sum_per_row(shifted)[:, None])
