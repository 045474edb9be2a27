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
"""

from typing import Any

import numba
import numpy as np

from serd_core.arrays import FloatArray
from serd_core.bellman.linear.policy_pattern import PolicyPattern

_compiled: Any = numba.njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})


class SweptMatrix:
    """A, and its rows divided by the pivots d; read by columns those are A^T / d.

    lumped: share of the fill that pivots take up; kind: type of the divided rows and the vectors.
    """

    def __init__(
        self, pattern: PolicyPattern, data: FloatArray, lumped: float = 0.0, kind: Any = np.float64
    ) -> None:
        self._matrix = pattern.matrix(data)
        self._pivots = np.empty(pattern.n_states)
        scaled: Any = np.empty(len(data), dtype=kind)
        structure = pattern.row_start, pattern.column, data, pattern.diagonal
        _scale_rows(*structure, lumped, self._pivots, scaled)
        self._stored = (pattern.row_start, pattern.column, scaled, pattern.diagonal)

    def product(self, vector: FloatArray, transposed: bool) -> FloatArray:
        """(S,) A x, or A^T x."""
        return np.asarray((self._matrix.T if transposed else self._matrix) @ vector)

    def solve(
        self,
        right_side: FloatArray,
        transposed: bool,
        relative_residual: float,
        max_iterations: int,
    ) -> FloatArray:
        """(S,) x near the solution of A x = b or A^T x = b, as far as the recurrences got."""
        by_rows = not transposed
        size = float(np.max(np.abs(right_side))) or 1.0
        remaining = right_side / (size * self._pivots if by_rows else size)
        remaining = remaining.astype(self._stored[2].dtype, copy=False)
        _solve_lower(*self._stored, by_rows, remaining)
        solution: Any = _bicgstab(
            *self._stored, by_rows, remaining, relative_residual, max_iterations
        )
        _solve_upper(*self._stored, by_rows, solution)
        solution = solution.astype(np.float64, copy=False)
        solution *= size
        if transposed:
            solution /= self._pivots
        return np.asarray(solution)


@_compiled
def _scale_rows(start, index, numbers, diagonal, lumped, pivots, scaled):  # type: ignore[no-untyped-def]
    """scaled <- rows of A over their pivots, which the rows before them determine."""
    ahead = np.empty(len(pivots))
    for i in range(len(pivots)):
        pivot = numbers[diagonal[i]]
        for place in range(start[i], diagonal[i]):
            pivot -= lumped * numbers[place] * ahead[index[place]]
        total = 0.0
        for place in range(diagonal[i] + 1, start[i + 1]):
            total += numbers[place]
        ahead[i], pivots[i] = total / pivot, pivot
        for place in range(start[i], start[i + 1]):
            scaled[place] = numbers[place] / pivot


@_compiled
def _solve_lower(start, index, numbers, diagonal, by_rows, x):  # type: ignore[no-untyped-def]
    """x <- (I + L)^-1 x."""
    for i in range(len(x)):
        own = x[i]
        if by_rows:
            for place in range(start[i], diagonal[i]):
                own -= numbers[place] * x[index[place]]
            x[i] = own
        else:
            for place in range(diagonal[i] + 1, start[i + 1]):
                x[index[place]] -= numbers[place] * own


@_compiled
def _solve_upper(start, index, numbers, diagonal, by_rows, x):  # type: ignore[no-untyped-def]
    """x <- (I + U)^-1 x."""
    for i in range(len(x) - 1, -1, -1):
        own = x[i]
        if by_rows:
            for place in range(diagonal[i] + 1, start[i + 1]):
                own -= numbers[place] * x[index[place]]
            x[i] = own
        else:
            for place in range(start[i], diagonal[i]):
                x[index[place]] -= numbers[place] * own


@_compiled
def _product(start, index, numbers, diagonal, by_rows, v, y, w):  # type: ignore[no-untyped-def]
    """w <- (I + L)^-1 A (I + U)^-1 v, with y as work space."""
    two = numbers.dtype.type(2.0)
    for i in range(len(v)):
        y[i] = v[i]
    _solve_upper(start, index, numbers, diagonal, by_rows, y)
    for i in range(len(v)):
        w[i] = v[i] + (numbers[diagonal[i]] - two) * y[i]
    _solve_lower(start, index, numbers, diagonal, by_rows, w)
    for i in range(len(v)):
        w[i] += y[i]


@_compiled
def _dot(a, b):  # type: ignore[no-untyped-def]
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@_compiled
def _bicgstab(  # type: ignore[no-untyped-def]
    start, index, numbers, diagonal, by_rows, r, relative_residual, max_iterations
):
    """x of the preconditioned system from zero (van der Vorst 1992); r, its right side, is used up.

    Ends early where a recurrence breaks down, with what it has. Sums have double precision.
    """
    size, kind = len(r), r.dtype.type
    shadow, x, p, v = r.copy(), np.zeros_like(r), np.zeros_like(r), np.zeros_like(r)
    t, y = np.empty_like(r), np.empty_like(r)
    rho, step, omega = 1.0, 1.0, 1.0
    alpha, beta, minus = kind(0.0), kind(0.0), kind(0.0)
    remaining = _dot(r, r)
    target = relative_residual**2 * remaining
    for _ in range(max_iterations):
        rho_before, rho = rho, _dot(shadow, r)
        if remaining <= target or rho == 0.0 or omega == 0.0:
            break
        beta = kind(rho / rho_before * step / omega)
        for i in range(size):
            p[i] = r[i] + beta * (p[i] - minus * v[i])
        _product(start, index, numbers, diagonal, by_rows, p, y, v)
        along = _dot(shadow, v)
        if along == 0.0:
            break
        step = rho / along
        alpha = kind(step)
        for i in range(size):
            r[i] -= alpha * v[i]
        _product(start, index, numbers, diagonal, by_rows, r, y, t)
        length = _dot(t, t)
        omega = _dot(t, r) / length if length > 0.0 else 0.0
        minus = kind(omega)
        remaining = 0.0
        for i in range(size):
            x[i] += alpha * p[i] + minus * r[i]
            r[i] -= minus * t[i]
            remaining += r[i] * r[i]
    return x
