"""Iterative solution of the linear systems where an LU factor would take long or not fit.

BiCGSTAB, restarted from its true residual until that is small enough: the recurrences drift from it
by rounding.
"""

from dataclasses import dataclass
from functools import cached_property
from inspect import signature
from typing import Any

import numpy as np
import scipy.sparse.linalg

from serd_core.arrays import FloatArray
from serd_core.bellman.linear.linear_solver import LinearSolver, LinearSystem
from serd_core.bellman.linear.policy_pattern import PolicyPattern
from serd_core.errors import SerdError

#: What one run of BiCGSTAB is asked to gain before it is restarted.
GAIN_PER_RUN = 1e-6
#: Name of the bound on the relative residual, another one before SciPy 1.12.
_BOUND = "rtol" if "rtol" in signature(scipy.sparse.linalg.bicgstab).parameters else "tol"


@dataclass(frozen=True)
class Krylov(LinearSolver):
    """Solves linear systems of many states by restarted BiCGSTAB, without a whole factor.

    relative_residual: |b - A x| / |b| to reach, unless `solve` allows more.
    max_iterations: of each run; max_runs: bound of the restarts.
    """

    relative_residual: float = 1e-11
    max_iterations: int = 10_000
    max_runs: int = 10

    def prepare(self, pattern: PolicyPattern, data: FloatArray) -> LinearSystem:
        return KrylovSystem(self, pattern.matrix(data))


@dataclass(frozen=True, eq=False)
class KrylovSystem(LinearSystem):
    """One matrix by rows."""

    settings: Krylov
    matrix: Any

    def solve(
        self, right_side: FloatArray, *, transposed: bool = False, relative_residual: float = 0.0
    ) -> FloatArray:
        """Solve column by column; SerdError where the residual cannot be reached."""
        target = max(relative_residual, self.settings.relative_residual)
        if right_side.ndim == 1:
            return self._solve_one(right_side, transposed, target)
        columns = [self._solve_one(column, transposed, target) for column in right_side.T]
        return np.stack(columns, axis=1)

    def _solve_one(self, right_side: FloatArray, transposed: bool, target: float) -> FloatArray:
        matrix = self._transposed if transposed else self.matrix
        size = float(np.linalg.norm(right_side))
        solution, left = np.zeros_like(right_side), right_side
        for _ in range(self.settings.max_runs):
            length = float(np.linalg.norm(left))
            if length <= target * size:
                return solution
            improved, _ = scipy.sparse.linalg.bicgstab(
                matrix,
                left,
                atol=0.0,
                maxiter=self.settings.max_iterations,
                **{_BOUND: max(0.5 * target * size / length, GAIN_PER_RUN)},
            )
            improved += solution
            remaining = right_side - matrix @ improved
            if not np.linalg.norm(remaining) < length:
                break
            solution, left = improved, remaining
        share = float(np.linalg.norm(left)) / size
        if share <= target:
            return solution
        raise SerdError(
            f"Krylov must reach a relative residual of {target}, got {share}; raise"
            " max_iterations, or use SparseLu"
        )

    @cached_property
    def _transposed(self) -> Any:
        return self.matrix.T.tocsr()
