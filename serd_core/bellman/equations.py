"""Soft and hard Bellman equations, and the part in which they differ.

    Q(s, a) = R(s, a) + gamma sum_s' P(s' | s, a) V(s')
    V(s)    = some maximum over the available actions of Q(s, a)

Both maxima M are convex, monotone and shift with constants, so T V = M(R + gamma P V) is a
gamma-contraction, and its derivative by V is gamma P_pi with pi(a | s) = dM/dQ(s, a).

Soft (maximum discounted causal entropy, Eqs. 3.28 to 3.30; the temperature is 1):
V(s) = log sum_a exp Q(s, a) and pi(a | s) = exp(Q(s, a) - V(s)).
Hard (optimal control, Eqs. 2.24 to 2.26): V(s) = max_a Q(s, a) and pi greedy.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from serd_core.arrays import FloatArray, largest_per_row, sum_per_row


class BellmanEquation(ABC):
    """A maximum over actions and its derivative; Q is -inf where an action is unavailable.

    curved: whether the maximum has second derivatives; they are then those of log-sum-exp.
    """

    curved: ClassVar[bool]

    @abstractmethod
    def maximum(self, q: FloatArray) -> FloatArray:
        """(S,) maximum over the actions of (S, A) values."""

    @abstractmethod
    def policy(self, q: FloatArray) -> FloatArray:
        """(S, A) derivative of the maximum: the policy along which gradients propagate."""

    def policy_at(self, q: FloatArray, maximum: FloatArray) -> FloatArray:
        """The same for a known maximum, whose rounding error each probability then has."""
        del maximum
        return self.policy(q)


@dataclass(frozen=True)
class SoftBellman(BellmanEquation):
    """Log-sum-exp over actions; its derivative is the Boltzmann policy."""

    curved = True

    def maximum(self, q: FloatArray) -> FloatArray:
        """(S,) log sum_a exp Q(s, a) (3.29)."""
        highest = largest_per_row(q)
        shifted = np.exp(q - highest[:, None])
        return np.asarray(highest + np.log(sum_per_row(shifted)))

    def policy(self, q: FloatArray) -> FloatArray:
        """(S, A) Boltzmann distribution over Q (3.30)."""
        return boltzmann(q, 1.0)

    def policy_at(self, q: FloatArray, maximum: FloatArray) -> FloatArray:
        policy = q - maximum[:, None]
        return np.exp(policy, out=policy)


def boltzmann(q: FloatArray, temperature: float) -> FloatArray:
    """(S, A) probabilities proportional to exp(Q(s, a) / temperature) (4.62)."""
    shifted = np.exp((q - largest_per_row(q)[:, None]) / temperature)
    return np.asarray(shifted / sum_per_row(shifted)[:, None])


@dataclass(frozen=True)
class HardBellman(BellmanEquation):
    """Maximum over actions; a derivative is the greedy policy (a sub-derivative at ties)."""

    curved = False

    def maximum(self, q: FloatArray) -> FloatArray:
        """(S,) max_a Q(s, a) (2.25)."""
        return largest_per_row(q)

    def policy(self, q: FloatArray) -> FloatArray:
        """(S, A) greedy policy (2.26), the first of equal actions."""
        greedy = np.zeros_like(q)
        greedy[np.arange(len(q)), q.argmax(axis=1)] = 1.0
        return greedy
