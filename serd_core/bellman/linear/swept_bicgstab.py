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

Two threads work on two halves of the states in twisted order: on the first half from its first
state on, on the second from its last state back, so that only the seam, where entries lead from one
half to the other, is left to be done at the end (H. A. van der Vorst, Parallel Computing 5, 1987).
The order does not depend on the number of threads, and neither does any result.
"""

from collections.abc import Callable
from typing import Any

import numba
import numpy as np

from serd_core.arrays import FloatArray
from serd_core.bellman.linear.policy_pattern import PolicyPattern
from serd_core.compiled import side_by_side

_compiled: Any = numba.njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})


class SweptMatrix:
    """A, and its rows divided by the pivots d; read by columns those are A^T / d.

    lumped: share of the fill that pivots take up; kind: type of the divided rows and the vectors.
    """

    def __init__(
        self, pattern: PolicyPattern, data: FloatArray, lumped: float = 0.0, kind: Any = np.float64
    ) -> None:
        self._matrix = pattern.matrix(data)
        self._seam = pattern.seam
        pivots, scaled = np.empty(pattern.n_states), np.empty(len(data), dtype=kind)
        structure = pattern.row_start, pattern.column, data, pattern.diagonal
        given = *structure, lumped, np.empty(pattern.n_states), pivots, scaled
        with side_by_side(self._seam.sides) as on_sides:
            on_sides(_scale_rows, *given)
        _scale_rows(self._seam.part, *given)
        self._pivots = pivots
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
        # What breaks down is not finite and no better than zero, which callers see.
        with side_by_side(self._seam.sides) as on_sides, np.errstate(all="ignore"):
            solution = self._bicgstab(
                on_sides, by_rows, remaining, relative_residual, max_iterations
            ).astype(np.float64, copy=False)
        solution *= size
        if transposed:
            solution /= self._pivots
        return np.asarray(solution)

    def _bicgstab(
        self,
        on_sides: Callable[..., list[Any]],
        by_rows: bool,
        r: Any,
        relative_residual: float,
        max_iterations: int,
    ) -> Any:
        """x near the solution, from zero (van der Vorst 1992); uses up the right side r.

        Ends early where a recurrence breaks down, with what it has. Sums have double precision.
        """
        kind, given, seam = r.dtype.type, (*self._stored, by_rows), self._seam

        def everywhere(work: Callable[..., Any], *more: Any) -> list[Any]:
            return [*on_sides(work, *more), work(seam.part, *more)]

        def product(v: Any, y: Any, w: Any, other: Any) -> FloatArray:
            """w <- (I + L)^-1 A (I + U)^-1 v for y = v, which is used up; w . w and other . w."""
            _solve_upper(seam.part, *given, v, y, w)
            return lower(on_sides(_product, *given, v, y, w, other), y, w, other)

        def lower(sums: list[Any], y: Any, w: Any, other: Any) -> FloatArray:
            """What is left to do at the seam when the sides are done, and the whole sums."""
            if not by_rows:
                _cross_seam(seam.first, seam.middle, *self._stored[:3], y, w)
            sums.append(_solve_lower(seam.part, *given, y, w, other))
            return np.asarray(np.sum(sums, axis=0))

        x, p, v, y = (np.zeros_like(r) for _ in range(4))
        squared = rho = lower(on_sides(_solve_lower, *given, y, r, r), y, r, r)[0]
        shadow, t, target = r.copy(), np.empty_like(r), relative_residual**2 * squared
        beta, minus = kind(0.0), kind(0.0)
        for _ in range(max_iterations):
            if squared <= target or rho == 0.0:
                break
            everywhere(_turn, beta, minus, r, v, p, y)
            _, along = product(p, y, v, shadow)
            if along == 0.0:
                break
            step = rho / along
            alpha = kind(step)
            everywhere(_shorten, alpha, v, r, y)
            length, along = product(r, y, t, r)
            omega = along / length if length > 0.0 else 0.0
            minus, rho_before = kind(omega), rho
            sums = everywhere(_advance, alpha, minus, p, t, shadow, x, r)
            squared, rho = np.sum(sums, axis=0)
            if omega == 0.0:
                break
            beta = kind(rho / rho_before * step / omega)
        y[:] = x
        _solve_upper(seam.part, *given, x, y, t)
        on_sides(_solve_upper, *given, x, y, t)
        return y


@_compiled
def _scale_rows(  # type: ignore[no-untyped-def]
    part, start, index, numbers, diagonal, lumped, ahead, pivots, scaled
):
    """scaled <- rows of A over their pivots, which the rows before them determine.

    ahead: work space, (S,) sums of the scaled entries after the diagonal in twisted order.
    """
    low, high, middle = part
    turned = low >= middle
    for k in range(high - low):
        i = high - 1 - k if turned else low + k
        pivot, total = numbers[diagonal[i]], 0.0
        for place in range(start[i], start[i + 1]):
            j = index[place]
            if (j > i or j < middle) if turned else j < i:
                pivot -= lumped * numbers[place] * ahead[j]
            elif j != i:
                total += numbers[place]
        ahead[i], pivots[i] = total / pivot, pivot
        for place in range(start[i], start[i + 1]):
            scaled[place] = numbers[place] / pivot


@_compiled
def _solve_upper(part, start, index, numbers, diagonal, by_rows, v, y, w):  # type: ignore[no-untyped-def]
    """y <- (I + U)^-1 y, w <- v + (D - 2 I) y."""
    low, high, middle = part
    two, turned = numbers.dtype.type(2.0), low >= middle
    start, diagonal = start[low : high + 1], diagonal[low:high]
    v, w, solved = v[low:high], w[low:high], y[low:high]
    for k in range(len(v)):
        i = k if turned else len(v) - 1 - k
        first, last = start[i], start[i + 1]
        own = solved[i]
        if by_rows:
            if turned:
                last = diagonal[i]
                while index[first] < middle:
                    first += 1
            else:
                first = diagonal[i] + 1
            for place in range(first, last):
                own -= numbers[place] * y[index[place]]
            solved[i] = own
        elif turned:
            for place in range(diagonal[i] + 1, last):
                y[index[place]] -= numbers[place] * own
            while index[first] < middle:
                y[index[first]] -= numbers[first] * own
                first += 1
        else:
            for place in range(first, diagonal[i]):
                y[index[place]] -= numbers[place] * own
        w[i] = v[i] + (numbers[diagonal[i]] - two) * own


@_compiled
def _solve_lower(part, start, index, numbers, diagonal, by_rows, y, w, other):  # type: ignore[no-untyped-def]
    """y <- (I + L)^-1 w, w <- that + y; w . w and other . w then.

    Columns do not cross the seam.
    """
    low, high, middle = part
    turned = low >= middle
    start, diagonal = start[low : high + 1], diagonal[low:high]
    added, ended, other = y[low:high], w[low:high], other[low:high]
    squared, along = 0.0, 0.0
    for k in range(len(ended)):
        i = len(ended) - 1 - k if turned else k
        first, last = start[i], start[i + 1]
        own = ended[i]
        if by_rows:
            if turned:
                while index[first] < middle:
                    own -= numbers[first] * y[index[first]]
                    first += 1
                first = diagonal[i] + 1
            else:
                last = diagonal[i]
            for place in range(first, last):
                own -= numbers[place] * y[index[place]]
        else:
            if turned:
                last = diagonal[i]
                while index[first] < middle:
                    first += 1
            else:
                first = diagonal[i] + 1
                while index[last - 1] >= middle:
                    last -= 1
            for place in range(first, last):
                w[index[place]] -= numbers[place] * own
        total = own + added[i]
        added[i], ended[i] = own, total
        squared += total * total
        along += total * other[i]
    return squared, along


@_compiled
def _cross_seam(first, middle, start, index, numbers, y, w):  # type: ignore[no-untyped-def]
    """w <- w - L y for the columns before the seam, in the rows of the seam."""
    for i in range(first, middle):
        place = start[i + 1] - 1
        while index[place] >= middle:
            w[index[place]] -= numbers[place] * y[i]
            place -= 1


@_compiled
def _product(part, start, index, numbers, diagonal, by_rows, v, y, w, other):  # type: ignore[no-untyped-def]
    given = start, index, numbers, diagonal, by_rows
    _solve_upper(part, *given, v, y, w)
    return _solve_lower(part, *given, y, w, other)


@_compiled
def _turn(part, beta, minus, r, v, p, y):  # type: ignore[no-untyped-def]
    """p <- r + beta (p - minus v), y <- p."""
    low, high, _ = part
    r, v, p, y = r[low:high], v[low:high], p[low:high], y[low:high]
    for i in range(len(p)):
        p[i] = y[i] = r[i] + beta * (p[i] - minus * v[i])


@_compiled
def _shorten(part, alpha, v, r, y):  # type: ignore[no-untyped-def]
    """r <- r - alpha v, y <- r."""
    low, high, _ = part
    r, v, y = r[low:high], v[low:high], y[low:high]
    for i in range(len(r)):
        r[i] = y[i] = r[i] - alpha * v[i]


@_compiled
def _advance(part, alpha, minus, p, t, shadow, x, r):  # type: ignore[no-untyped-def]
    """x <- x + alpha p + minus r, r <- r - minus t; r . r and shadow . r then."""
    low, high, _ = part
    p, t, shadow, x, r = p[low:high], t[low:high], shadow[low:high], x[low:high], r[low:high]
    squared, along = 0.0, 0.0
    for i in range(len(x)):
        x[i] += alpha * p[i] + minus * r[i]
        own = r[i] - minus * t[i]
        r[i] = own
        squared += own * own
        along += own * shadow[i]
    return squared, along
