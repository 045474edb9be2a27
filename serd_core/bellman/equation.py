"""The part in which soft and hard Bellman equations differ.

    Q(s, a) = R(s, a) + gamma sum_s' P(s' | s, a) V(s')
    V(s)    = some maximum over the available actions of Q(s, a)

Both maxima M are convex, monotone and shift with constants, so T V = M(R + gamma P V) is a
gamma-contraction, and its derivative by V is gamma P_pi with pi(a | s) = dM/dQ(s, a).
"""

from abc import ABC, abstractmethod

from serd_core.arrays import FloatArray


class BellmanEquation(ABC):
    """A maximum over actions and its derivative; Q is -inf where an action is unavailable."""

    @property
    @abstractmethod
    def curved(self) -> bool:
        """Whether the maximum has second derivatives; they are then those of log-sum-exp."""

    @abstractmethod
    def maximum(self, q: FloatArray) -> FloatArray:
        """(S,) maximum over the actions of (S, A) values."""

    @abstractmethod
    def policy(self, q: FloatArray) -> FloatArray:
        """(S, A) derivative of the maximum: the policy along which gradients propagate."""
