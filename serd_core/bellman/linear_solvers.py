"""Linear systems (I - gamma P_pi) x = b, and with the transposed matrix.

A band is factorised where it is narrow, as in hallways of any length (LAPACK's gbtrf): states
reordered by reverse Cuthill-McKee lie near their successors. The transpose is factorised: it is
diagonally dominant by columns, so that no rows are exchanged. A sparse matrix of few states is
factorised too; it is strictly diagonally dominant by rows, so that elimination needs no pivoting
and may follow the order of least fill. Elsewhere BiCGSTAB takes less time than a factor, unless one
factor serves many right-hand sides; factors fill up where the band is wide.
"""

from abc import ABC, abstractmethod
from inspect import signature

import numpy as np
import scipy.linalg.lapack
import scipy.sparse.linalg

from serd_core.arrays import FloatArray
from serd_core.bellman.policy_pattern import PolicyPattern
from serd_core.errors import SerdError

#: Off-diagonals on either side up to which a band is factorised, and states up to which a sparse
#: matrix is: for few right-hand sides, and for more than MANY_SIDES.
WIDEST_BAND, LARGEST_LU, LARGEST_SHARED_LU, MANY_SIDES = 65, 5_000, 300_000, 10
#: Share of the states that a band covers where factors fill up, and states from which that counts.
WIDE, SMALL_STATES = 0.25, 500
#: |b - A x| / |b| that BiCGSTAB reaches unless more is allowed; of its runs, what each is asked to
#: gain before it is restarted from the true residual, from which the recurrences drift by rounding.
RESIDUAL, GAIN_PER_RUN, MAX_RUNS, MAX_ITERATIONS = 1e-11, 1e-6, 10, 10_000
#: Name of the bound on the relative residual, another one before SciPy 1.12.
_BOUND = "rtol" if "rtol" in signature(scipy.sparse.linalg.bicgstab).parameters else "tol"


class LinearSystem(ABC):
    """One matrix I - gamma P_pi, of a pattern with its (nnz,) numbers, for several b."""

    @abstractmethod
    def __init__(self, pattern: PolicyPattern, data: FloatArray) -> None: ...

    @abstractmethod
    def solve(
        self, right_side: FloatArray, *, transposed: bool = False, relative_residual: float = 0.0
    ) -> FloatArray:
        """x with (I - gamma P_pi) x = b, or with its transpose, for b of shape (S,) or (S, n).

        An iterative solver may stop at |b - A x| <= relative_residual |b|; 0 asks for its best.
        """


def kind_of(pattern: PolicyPattern, right_sides: int = 1) -> type[LinearSystem]:
    """The system that takes least time for a pattern and so many right-hand sides."""
    if pattern.band.width <= WIDEST_BAND:
        return BandedFactor
    fills_up = pattern.n_states > SMALL_STATES and pattern.band.width > WIDE * pattern.n_states
    largest = LARGEST_LU if right_sides <= MANY_SIDES else LARGEST_SHARED_LU
    return LuFactor if pattern.n_states <= largest and not fills_up else KrylovSystem


class LuFactor(LinearSystem):
    """A factor of SuperLU, of the symmetrically reordered matrix."""

    def __init__(self, pattern: PolicyPattern, data: FloatArray) -> None:
        self._factor = scipy.sparse.linalg.splu(
            pattern.matrix(data).tocsc(),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )

    def solve(
        self, right_side: FloatArray, *, transposed: bool = False, relative_residual: float = 0.0
    ) -> FloatArray:
        del relative_residual
        return np.asarray(self._factor.solve(right_side, trans="T" if transposed else "N"))


class BandedFactor(LinearSystem):
    """Factor of the reordered, transposed band, as LAPACK keeps it."""

    def __init__(self, pattern: PolicyPattern, data: FloatArray) -> None:
        self._band = band = pattern.band
        self._factor, self._pivots, failed = scipy.linalg.lapack.dgbtrf(
            band.filled(data), band.below, band.above, overwrite_ab=1
        )
        if failed:
            raise SerdError(
                f"I - gamma P_pi must be invertible, but pivot {failed} of its band is 0; check"
                " that the transition probabilities are finite"
            )

    def solve(
        self, right_side: FloatArray, *, transposed: bool = False, relative_residual: float = 0.0
    ) -> FloatArray:
        del relative_residual
        band, given = self._band, right_side[self._band.order]
        reordered, _ = scipy.linalg.lapack.dgbtrs(
            self._factor, band.below, band.above, given, self._pivots, int(not transposed)
        )
        return np.asarray(reordered[band.rank])


class KrylovSystem(LinearSystem):
    """Restarted BiCGSTAB, and a sparse factor from the first time on that it fails."""

    def __init__(self, pattern: PolicyPattern, data: FloatArray) -> None:
        self._given, self._matrix = (pattern, data), pattern.matrix(data)
        self._transposed: scipy.sparse.csr_array | None = None
        self._factor: LuFactor | None = None

    def solve(
        self, right_side: FloatArray, *, transposed: bool = False, relative_residual: float = 0.0
    ) -> FloatArray:
        target, columns = max(relative_residual, RESIDUAL), np.atleast_2d(right_side.T)
        if transposed and self._transposed is None:
            self._transposed = self._matrix.T.tocsr()
        matrix = self._transposed if transposed else self._matrix
        solved = []
        for column in columns if self._factor is None else ():
            solution = _iterated(matrix, column, target)
            if solution is None:
                self._factor = LuFactor(*self._given)
                break
            solved.append(solution)
        if self._factor is not None:
            return self._factor.solve(right_side, transposed=transposed)
        return np.stack(solved, axis=-1).reshape(right_side.shape)


def _iterated(
    matrix: scipy.sparse.csr_array, right_side: FloatArray, target: float
) -> FloatArray | None:
    """Solution with the residual wanted, None where that is not reached."""
    size = float(np.linalg.norm(right_side))
    solution, left = np.zeros_like(right_side), right_side
    for _ in range(MAX_RUNS):
        length = float(np.linalg.norm(left))
        if length <= target * size:
            return solution
        bound = max(0.5 * target * size / length, GAIN_PER_RUN)
        improved, _ = scipy.sparse.linalg.bicgstab(
            matrix, left, atol=0.0, maxiter=MAX_ITERATIONS, **{_BOUND: bound}
        )
        improved += solution
        remaining = right_side - matrix @ improved
        if not np.linalg.norm(remaining) < length:
            return None
        solution, left = improved, remaining
    return solution if np.linalg.norm(left) <= target * size else None
