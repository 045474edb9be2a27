"""Sparse LU factorisation of the S x S system with an ordering found once per MDP.

I - gamma P_pi is strictly diagonally dominant by rows, so elimination needs no pivoting and the
same fill-reducing order serves every policy.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse.linalg

from serd_core.arrays import FloatArray, IntArray
from serd_core.bellman.linear.linear_solver import LinearSolver, LinearSystem
from serd_core.bellman.linear.policy_pattern import PolicyPattern


@dataclass(frozen=True)
class SparseLu(LinearSolver):
    """SuperLU on the symmetrically reordered matrix."""

    def prepare(self, pattern: PolicyPattern, data: FloatArray) -> LinearSystem:
        """Factorise the matrix with the given numbers."""
        elimination = pattern.elimination
        factor = scipy.sparse.linalg.splu(
            elimination.matrix(data),
            permc_spec="NATURAL",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
        return LuFactor(factor=factor, order=elimination.order)


@dataclass(frozen=True, eq=False)
class LuFactor(LinearSystem):
    """Factor of the reordered matrix; state `order[i]` is its i-th unknown."""

    factor: Any
    order: IntArray

    def solve(
        self, right_side: FloatArray, *, transposed: bool = False, relative_residual: float = 0.0
    ) -> FloatArray:
        """Solve to rounding."""
        del relative_residual
        solution = np.empty_like(right_side)
        trans = "T" if transposed else "N"
        solution[self.order] = self.factor.solve(right_side[self.order], trans=trans)
        return solution
