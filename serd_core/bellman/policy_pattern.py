"""Symbolic structure of the S x S matrix I - gamma P_pi, the same for every policy.

    P_pi[s, s'] = sum_a pi(a | s) P(s' | s, a)

The matrix is stored by rows (CSR). Only its numbers change between solves, so positions are
computed once per model and each matrix costs one weighted count over the entries.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy  # loads sparse at its first use

from serd_core.arrays import FloatArray, IntArray


def index_type(largest: int) -> type[np.signedinteger]:
    """Type of the index arrays of SciPy's sparse matrices that hold indices up to `largest`."""
    return np.int32 if largest < 2**31 else np.int64


@dataclass(frozen=True, eq=False)
class PolicyPattern:
    """Places of the non-zeros of I - gamma P_pi.

    diagonal: (S,) places of the diagonal; row_start (S + 1,), column (nnz,): CSR structure.
    places: (nnz, S*A) matrix with a column per row of P, by columns; its numbers are replaced.
    """

    diagonal: IntArray
    row_start: IntArray
    column: IntArray
    places: scipy.sparse.csc_array

    @property
    def n_states(self) -> int:
        """Number of states S."""
        return len(self.diagonal)

    def matrix(self, data: FloatArray) -> scipy.sparse.csr_array:
        """(S, S) matrix with the given (nnz,) numbers."""
        shape = (self.n_states, self.n_states)
        return scipy.sparse.csr_array((data, self.column, self.row_start), shape=shape)

    def system_data(
        self, policy: FloatArray, probabilities: FloatArray, discount: float
    ) -> FloatArray:
        """(nnz,) numbers of I - gamma P_pi for an (S, A) policy and (E,) entries."""
        data: FloatArray = with_numbers(self.places, probabilities) @ policy.ravel()
        data *= -discount
        data[self.diagonal] += 1.0
        return data

    @cached_property
    def band(self) -> Band:
        """The transposed pattern reordered symmetrically for a narrow band, found once."""
        matrix = self.matrix(np.ones(len(self.column)))
        order = scipy.sparse.csgraph.reverse_cuthill_mckee(matrix, symmetric_mode=False)
        rank = np.argsort(order)
        row = np.repeat(np.arange(self.n_states), np.diff(self.row_start))
        row, column = rank[self.column], rank[row]  # of the transpose
        below, above = int(np.max(row - column)), int(np.max(column - row))
        place = column * (2 * below + above + 1) + below + above + row - column
        return Band(np.asarray(order, dtype=np.int64), rank, below, above, place)


@dataclass(frozen=True, eq=False)
class Band:
    """Reordered transpose as LAPACK stores bands: entry (i, j) in row below + above + i - j.

    State `order[i]` is the i-th unknown and `rank` the inverse; below, above: diagonals on either
    side of the main one; place: (nnz,) position of each number of the pattern in the flat band.
    """

    order: IntArray
    rank: IntArray
    below: int
    above: int
    place: IntArray

    @property
    def width(self) -> int:
        """Diagonals on the wider side."""
        return max(self.below, self.above)

    def filled(self, data: FloatArray) -> FloatArray:
        """(rows, S) band, by columns in memory, for data in the order of the pattern."""
        n_rows = 2 * self.below + self.above + 1
        flat = np.zeros(n_rows * len(self.order))
        flat[self.place] = data
        return flat.reshape(len(self.order), n_rows).T


def policy_pattern(
    row: IntArray, successor: IntArray, n_states: int, n_actions: int
) -> PolicyPattern:
    """Pattern for entries with the given rows (s * n_actions + a) and successors."""
    own = np.arange(n_states, dtype=np.int64)
    keys = np.concatenate([row // n_actions * n_states + successor, own * (n_states + 1)])
    unique, place = np.unique(keys, return_inverse=True)
    row_start = np.searchsorted(unique, np.arange(n_states + 1, dtype=np.int64) * n_states)
    kind = index_type(len(keys))
    place = place.reshape(-1).astype(kind)
    ends = np.searchsorted(row, np.arange(n_states * n_actions + 1)).astype(kind)
    structure = np.ones(len(row), dtype=np.int8), place[: len(row)], ends
    shape = (len(unique), n_states * n_actions)
    return PolicyPattern(
        diagonal=place[len(row) :],
        row_start=row_start.astype(kind),
        column=(unique % n_states).astype(kind),
        places=scipy.sparse.csc_array(structure, shape=shape),
    )


def with_numbers(
    structure: scipy.sparse.csr_array | scipy.sparse.csc_array, numbers: FloatArray
) -> scipy.sparse.csr_array | scipy.sparse.csc_array:
    """A matrix that shares the index arrays of `structure` and has the given (nnz,) numbers."""
    matrix = copy.copy(structure)
    matrix.data = numbers
    return matrix
