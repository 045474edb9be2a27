"""Linear systems (I - gamma P_pi) x = b, and with the transposed matrix."""

from abc import ABC, abstractmethod

from serd_core.arrays import FloatArray
from serd_core.dynamics.policy_pattern import PolicyPattern


class LinearSystem(ABC):
    """One matrix I - gamma P_pi, prepared for several right-hand sides."""

    @abstractmethod
    def solve(self, right_side: FloatArray) -> FloatArray:
        """x with (I - gamma P_pi) x = b for b of shape (S,) or (S, n)."""

    @abstractmethod
    def solve_transposed(self, right_side: FloatArray) -> FloatArray:
        """x with (I - gamma P_pi)^T x = b for b of shape (S,) or (S, n)."""


class LinearSolver(ABC):
    """A way to solve such systems."""

    @abstractmethod
    def prepare(self, pattern: PolicyPattern, data: FloatArray) -> LinearSystem:
        """Prepare the matrix with the given numbers (`PolicyPattern.system_data`)."""
