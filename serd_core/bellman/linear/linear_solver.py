"""Linear systems (I - gamma P_pi) x = b, and with the transposed matrix."""

from __future__ import annotations

from abc import ABC, abstractmethod
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

from serd_core.arrays import FloatArray
from serd_core.bellman.linear.policy_pattern import PolicyPattern
from serd_core.errors import SerdError


class LinearSystem(ABC):
    """One matrix I - gamma P_pi, prepared for several right-hand sides."""

    @abstractmethod
    def solve(
        self, right_side: FloatArray, *, transposed: bool = False, relative_residual: float = 0.0
    ) -> FloatArray:
        """x with (I - gamma P_pi) x = b, or with its transpose, for b of shape (S,) or (S, n).

        An iterative solver may stop at |b - A x| <= relative_residual |b|; 0 asks for its best.
        """

    def solver_of_next(self, solver: LinearSolver) -> LinearSolver:
        """The solver for another matrix of the same kind, where `solver` prepared this one."""
        return solver


class LinearSolver(ABC):
    """A way to solve such systems."""

    @abstractmethod
    def prepare(self, pattern: PolicyPattern, data: FloatArray) -> LinearSystem:
        """Prepare the matrix with the given numbers (`PolicyPattern.system_data`)."""

    def for_systems(self, *, right_sides: int) -> LinearSolver:
        """The solver for systems of so many right-hand sides."""
        del right_sides
        return self


@dataclass(frozen=True, eq=False)
class WithFallback(LinearSystem):
    """A system that may fail, and the solver that is used from its first failure on."""

    first: LinearSystem
    fallback: LinearSolver
    pattern: PolicyPattern
    data: FloatArray

    @cached_property
    def _other(self) -> LinearSystem:
        return self.fallback.prepare(self.pattern, self.data)

    def solver_of_next(self, solver: LinearSolver) -> LinearSolver:
        return self.fallback if "_other" in vars(self) else solver

    def solve(
        self, right_side: FloatArray, *, transposed: bool = False, relative_residual: float = 0.0
    ) -> FloatArray:
        """Solve by the first system, and by the other where that does not converge."""
        if "_other" not in vars(self):
            with suppress(SerdError):
                return self.first.solve(
                    right_side, transposed=transposed, relative_residual=relative_residual
                )
        return self._other.solve(right_side, transposed=transposed)
