"""Linear systems (I - gamma P_pi) x = b, and with the transposed matrix.

LU factorisations of the S x S system I - gamma P_pi.

Sparse: the matrix is strictly diagonally dominant by rows, so that elimination needs no pivoting
and may follow the order of least fill.

As a band matrix (LAPACK's gbtrf): states reordered by reverse Cuthill-McKee lie near their
successors: in a hallway of w cells across the band is about w wide, in a square of n states
sqrt(n). The work n * width^2 grows faster than that of a sparse factor with little fill, but it is
plain arithmetic, and small and narrow problems would spend their time on bookkeeping. The transpose
is factorised: it is diagonally dominant by columns, so that no rows are exchanged.

Iterative solution of the linear systems where an LU factor would take long or not fit.

BiCGSTAB, restarted from its true residual until that is small enough: the recurrences drift from it
by rounding.

Choice of the linear solver by the size of a problem and the width of its band.

A band is factorised where it is narrow, as in hallways of any length, and a sparse matrix of few
states too. Elsewhere BiCGSTAB takes less time than a factor, unless one factor serves many
right-hand sides; of graphs whose band is wide, which have no small separators, factors fill up.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from inspect import signature
from typing import Any

import numpy as np
import scipy.linalg.lapack
import scipy.sparse.linalg

from serd_core.arrays import FloatArray, IntArray
from serd_core.bellman.policy_pattern import Band, PolicyPattern
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


#: Share of the states that a band covers where factors fill up, and states from which that counts.
WIDE, SMALL_STATES = 0.25, 500
#: Right-hand sides from which a factor pays, and states up to which it then does.
MANY_SIDES, LARGEST_SHARED_LU = 10, 300_000


@dataclass(frozen=True)
class Automatic(LinearSolver):
    """Banded LU, sparse LU or BiCGSTAB, whichever fits; sparse LU is the fallback of BiCGSTAB.

    widest_band: off-diagonals on either side up to which a band is factorised.
    largest_lu_states: sparse LU up to this number of states, BiCGSTAB beyond.
    """

    widest_band: int = 65
    largest_lu_states: int = 5_000

    def for_systems(self, *, right_sides: int) -> LinearSolver:
        if right_sides <= MANY_SIDES or self.largest_lu_states != Automatic.largest_lu_states:
            return self
        return replace(self, largest_lu_states=LARGEST_SHARED_LU)

    def choose(self, pattern: PolicyPattern) -> LinearSolver:
        """The solver for the systems of a pattern."""
        n_states = pattern.n_states
        if pattern.band.width <= self.widest_band:
            return BandedLu()
        fills_up = n_states > SMALL_STATES and pattern.band.width > WIDE * n_states
        if n_states <= self.largest_lu_states and not fills_up:
            return SparseLu()
        return Krylov()

    def prepare(self, pattern: PolicyPattern, data: FloatArray) -> LinearSystem:
        solver = self.choose(pattern)
        system = solver.prepare(pattern, data)
        if isinstance(solver, Krylov):
            return WithFallback(system, SparseLu(), pattern, data)
        return system
