"""LU factorisations of the S x S system I - gamma P_pi.

Sparse: the matrix is strictly diagonally dominant by rows, so that elimination needs no pivoting
and may follow the order of least fill.

As a band matrix (LAPACK's gbtrf): states reordered by reverse Cuthill-McKee lie near their
successors: in a hallway of w cells across the band is about w wide, in a square of n states
sqrt(n). The work n * width^2 grows faster than that of a sparse factor with little fill, but it is
plain arithmetic, and small and narrow problems would spend their time on bookkeeping. The transpose
is factorised: it is diagonally dominant by columns, so that no rows are exchanged.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg.lapack
import scipy.sparse.linalg

from serd_core.arrays import FloatArray, IntArray
from serd_core.bellman.linear.linear_solver import LinearSolver, LinearSystem
from serd_core.bellman.linear.policy_pattern import Band, PolicyPattern
from serd_core.errors import SerdError


@dataclass(frozen=True)
class SparseLu(LinearSolver):
    """Solves linear systems of sparse graphs by SuperLU, on the symmetrically reordered matrix."""

    def prepare(self, pattern: PolicyPattern, data: FloatArray) -> LinearSystem:
        factor = scipy.sparse.linalg.splu(
            pattern.matrix(data).tocsc(),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
        return LuFactor(factor)


@dataclass(frozen=True, eq=False)
class LuFactor(LinearSystem):
    """A factor of SuperLU."""

    factor: Any

    def solve(
        self, right_side: FloatArray, *, transposed: bool = False, relative_residual: float = 0.0
    ) -> FloatArray:
        del relative_residual
        return np.asarray(self.factor.solve(right_side, trans="T" if transposed else "N"))


@dataclass(frozen=True)
class BandedLu(LinearSolver):
    """Solves linear systems of narrow graphs, such as hallways, by LAPACK on the reordered band."""

    def prepare(self, pattern: PolicyPattern, data: FloatArray) -> LinearSystem:
        """Factorise the matrix with the given numbers; SerdError where it is singular."""
        band = pattern.band
        factor, pivots, failed = scipy.linalg.lapack.dgbtrf(
            band.filled(data), band.below, band.above, overwrite_ab=1
        )
        if failed:
            raise SerdError(
                f"I - gamma P_pi must be invertible, but pivot {failed} of its band is 0; check"
                " that the transition probabilities are finite"
            )
        return BandedFactor(factor=factor, pivots=pivots, band=band)


@dataclass(frozen=True, eq=False)
class BandedFactor(LinearSystem):
    """Factor of the reordered, transposed band, as LAPACK keeps it."""

    factor: FloatArray
    pivots: IntArray
    band: Band

    def solve(
        self, right_side: FloatArray, *, transposed: bool = False, relative_residual: float = 0.0
    ) -> FloatArray:
        del relative_residual
        band, given = self.band, right_side[self.band.order]
        reordered, _ = scipy.linalg.lapack.dgbtrs(
            self.factor, band.below, band.above, given, self.pivots, int(not transposed)
        )
        return np.asarray(reordered[band.rank])
