"""BiCGSTAB preconditioned by sweeps with an incomplete factor in place, compiled by numba.

The rows of A = I - gamma P_pi are divided by pivots d, A = L + D + U (strictly lower, diagonal,
strictly upper), so that (I + L) (I + U) is near A. The preconditioned matrix in Eisenstat's form
(SIAM J. Sci. Stat. Comput. 2, 1981) is

    (I + L)^-1 A (I + U)^-1 v = y + (I + L)^-1 (v + (D - 2 I) y),    y = (I + U)^-1 v

A product with it reads A once, as a product with A does. Pivots that are the diagonal make it
symmetric Gauss-Seidel, with a third of the iterations. Pivots that also take up the fill of a
factor (Gustafsson, BIT 18, 1978) give it the row sums of A, nearly, and halve the iterations on
large grids once more; off-diagonals that are not positive and row sums that are not negative keep
them positive. Storage by rows serves A, and read by columns its transpose.

From QUICK_FROM states on a factor that takes up the fill is used in single precision first. It
fails where policies drift to and fro over long horizons, and plain sweeps follow then, as they do
from the start on graphs that are not local.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numba
import numpy as np

from serd_core.arrays import FloatArray
from serd_core.bellman.linear.krylov import Krylov, KrylovSystem
from serd_core.bellman.linear.linear_solver import LinearSolver, LinearSystem, WithFallback
from serd_core.bellman.linear.policy_pattern import PolicyPattern

#: States from which single precision and the fill are tried first: the share of the fill, and most
#: iterations of a run. On graphs without distances that takes three times the iterations.
QUICK_FROM, LUMPED, QUICK_ITERATIONS = 500_000, 0.95, 300
#: Share of the entries between the halves of the states up to which a graph is local.
MOST_CROSSING = 0.01

_compiled: Any = numba.njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})


@dataclass(frozen=True)
class Swept(LinearSolver):
    """BiCGSTAB preconditioned by sweeps.

    settings: limits of the iteration; fallback: the solver where it fails.
    quick_from: states from which the quick factor is tried.
    """

    settings: Krylov
    fallback: LinearSolver
    quick_from: int = QUICK_FROM

    def prepare(self, pattern: PolicyPattern, data: FloatArray) -> LinearSystem:
        """Keep the matrix, whose rows are scaled at the first right-hand side."""
        matrix = pattern.matrix(data)
        if pattern.n_states < self.quick_from or not _is_local(pattern):
            system = SweptSystem(self.settings, matrix, None, pattern)
            return WithFallback(system, self.fallback, pattern, data)
        settings = replace(self.settings, max_iterations=QUICK_ITERATIONS)
        quick = SweptSystem(settings, matrix, None, pattern, LUMPED, np.float32)
        plain = replace(self, quick_from=pattern.n_states + 1)
        return WithFallback(quick, plain, pattern, data)


@dataclass(frozen=True, eq=False)
class SweptSystem(KrylovSystem):
    """A, and its rows divided by the pivots d; read by columns those are A^T / d.

    lumped: share of the fill that pivots take up; kind: type of the divided rows and the vectors.
    """

    pattern: PolicyPattern
    lumped: float = 0.0
    kind: Any = np.float64

    @cached_property
    def _scaled(self) -> tuple[FloatArray, Any]:
        """(S,) pivots, and the divided rows with their structure."""
        pattern, data = self.pattern, self.matrix.data
        pivots, scaled = np.empty(pattern.n_states), np.empty(len(data), dtype=self.kind)
        structure = pattern.row_start, pattern.column, data, pattern.diagonal
        _scale_rows(*structure, self.lumped, np.empty(pattern.n_states), pivots, scaled)
        return pivots, (pattern.row_start, pattern.column, scaled, pattern.diagonal)

    def _product(self, vector: FloatArray, transposed: bool) -> FloatArray:
        return np.asarray((self.matrix.T if transposed else self.matrix) @ vector)

    def _run(
        self, right_side: FloatArray, transposed: bool, relative_residual: float
    ) -> FloatArray:
        pivots, _ = self._scaled
        size = float(np.max(np.abs(right_side))) or 1.0
        remaining = right_side / (size if transposed else size * pivots)
        remaining = remaining.astype(self.kind, copy=False)
        # What breaks down is not finite and no better than zero, which callers see.
        with np.errstate(all="ignore"):
            found = self._bicgstab(not transposed, remaining, relative_residual)
        solution = found.astype(np.float64, copy=False)
        solution *= size
        if transposed:
            solution /= pivots
        return np.asarray(solution)

    def _bicgstab(self, by_rows: bool, r: Any, relative_residual: float) -> Any:
        """x near the solution, from zero (van der Vorst 1992); uses up the right side r.

        Ends early where a recurrence breaks down, with what it has. Sums have double precision.
        """
        kind, given = r.dtype.type, (*self._scaled[1], by_rows)
        x, p, v, y = (np.zeros_like(r) for _ in range(4))
        squared = rho = _solve_lower(*given, y, r, r)[0]
        shadow, t, target = r.copy(), np.empty_like(r), relative_residual**2 * squared
        beta, minus = kind(0.0), kind(0.0)
        for _ in range(self.settings.max_iterations):
            if squared <= target or rho == 0.0:
                break
            _turn(beta, minus, r, v, p, y)
            _, along = _product(*given, p, y, v, shadow)
            if along == 0.0:
                break
            step = rho / along
            alpha = kind(step)
            _shorten(alpha, v, r, y)
            length, along = _product(*given, r, y, t, r)
            omega = along / length if length > 0.0 else 0.0
            minus, rho_before = kind(omega), rho
            squared, rho = _advance(alpha, minus, p, t, shadow, x, r)
            if omega == 0.0:
                break
            beta = kind(rho / rho_before * step / omega)
        y[:] = x
        _solve_upper(*given, x, y, t)
        return y


def _is_local(pattern: PolicyPattern) -> bool:
    """Whether few entries lead from one half of the states to the other, as on grids."""
    middle = pattern.n_states // 2
    start = int(pattern.row_start[middle])
    there = np.count_nonzero(pattern.column[:start] >= middle)
    back = np.count_nonzero(pattern.column[start:] < middle)
    return bool(there + back <= MOST_CROSSING * len(pattern.column))


@_compiled
def _scale_rows(start, index, numbers, diagonal, lumped, ahead, pivots, scaled):  # type: ignore[no-untyped-def]
    """scaled <- rows of A over their pivots, which the rows before them determine.

    ahead: work space, (S,) sums of the scaled entries after the diagonal.
    """
    for i in range(len(diagonal)):
        pivot, total = numbers[diagonal[i]], 0.0
        for place in range(start[i], diagonal[i]):
            pivot -= lumped * numbers[place] * ahead[index[place]]
        for place in range(diagonal[i] + 1, start[i + 1]):
            total += numbers[place]
        ahead[i], pivots[i] = total / pivot, pivot
        for place in range(start[i], start[i + 1]):
            scaled[place] = numbers[place] / pivot


@_compiled
def _solve_upper(start, index, numbers, diagonal, by_rows, v, y, w):  # type: ignore[no-untyped-def]
    """y <- (I + U)^-1 y, w <- v + (D - 2 I) y; by columns with the lower part, transposed."""
    two = numbers.dtype.type(2.0)
    for i in range(len(v) - 1, -1, -1):
        own = y[i]
        if by_rows:
            for place in range(diagonal[i] + 1, start[i + 1]):
                own -= numbers[place] * y[index[place]]
            y[i] = own
        else:
            for place in range(start[i], diagonal[i]):
                y[index[place]] -= numbers[place] * own
        w[i] = v[i] + (numbers[diagonal[i]] - two) * own


@_compiled
def _solve_lower(start, index, numbers, diagonal, by_rows, y, w, other):  # type: ignore[no-untyped-def]
    """y <- (I + L)^-1 w, w <- that + y; w . w and other . w then."""
    squared, along = 0.0, 0.0
    for i in range(len(w)):
        own = w[i]
        if by_rows:
            for place in range(start[i], diagonal[i]):
                own -= numbers[place] * y[index[place]]
        else:
            for place in range(diagonal[i] + 1, start[i + 1]):
                w[index[place]] -= numbers[place] * own
        total = own + y[i]
        y[i], w[i] = own, total
        squared += total * total
        along += total * other[i]
    return squared, along


@_compiled
def _product(start, index, numbers, diagonal, by_rows, v, y, w, other):  # type: ignore[no-untyped-def]
    """w <- (I + L)^-1 A (I + U)^-1 v for y = v, which is used up; w . w and other . w."""
    _solve_upper(start, index, numbers, diagonal, by_rows, v, y, w)
    return _solve_lower(start, index, numbers, diagonal, by_rows, y, w, other)


@_compiled
def _turn(beta, minus, r, v, p, y):  # type: ignore[no-untyped-def]
    """p <- r + beta (p - minus v), y <- p."""
    for i in range(len(p)):
        p[i] = y[i] = r[i] + beta * (p[i] - minus * v[i])


@_compiled
def _shorten(alpha, v, r, y):  # type: ignore[no-untyped-def]
    """r <- r - alpha v, y <- r."""
    for i in range(len(r)):
        r[i] = y[i] = r[i] - alpha * v[i]


@_compiled
def _advance(alpha, minus, p, t, shadow, x, r):  # type: ignore[no-untyped-def]
    """x <- x + alpha p + minus r, r <- r - minus t; r . r and shadow . r then."""
    squared, along = 0.0, 0.0
    for i in range(len(x)):
        x[i] += alpha * p[i] + minus * r[i]
        own = r[i] - minus * t[i]
        r[i] = own
        squared += own * own
        along += own * shadow[i]
    return squared, along
