"""Symbolic structure of the S x S matrix I - gamma P_pi, the same for every policy.

    P_pi[s, s'] = sum_a pi(a | s) P(s' | s, a)

The matrix is stored by rows (CSR). Only its numbers change between solves, so positions are
computed once per MDP and each matrix costs one weighted count over the entries.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy  # loads sparse at its first use

from serd_core.arrays import FloatArray, IntArray, matrix_index_type


@dataclass(frozen=True, eq=False)
class PolicyPattern:
    """Places of the non-zeros of I - gamma P_pi.

    diagonal: (S,) places of the diagonal; row_start (S + 1,), column (nnz,): CSR structure.
    """

    diagonal: IntArray
    row_start: IntArray
    column: IntArray

    @property
    def n_states(self) -> int:
        """Number of states S."""
        return len(self.diagonal)

    def matrix(self, data: FloatArray) -> scipy.sparse.csr_array:
        """(S, S) matrix with the given numbers."""
        return with_numbers(self._structure, data)

    @cached_property
    def _structure(self) -> scipy.sparse.csr_array:
        shape = (self.n_states,) * 2
        ones = np.ones(len(self.column), dtype=np.int8)
        return scipy.sparse.csr_array((ones, self.column, self.row_start), shape=shape)

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

    @cached_property
    def elimination(self) -> Elimination:
        """The pattern reordered symmetrically for little fill (minimum degree), found once."""
        # Off-diagonals of -1/degree make the sample matrix diagonally dominant, like every system.
        degree = np.diff(self.row_start).max()
        data = np.full(len(self.column), -1.0 / (degree + 1))
        data[self.diagonal] = 1.0
        # An incomplete factor that drops everything: its order is wanted, and costs less alone.
        factor = scipy.sparse.linalg.spilu(
            self.matrix(data).tocsc(),
            drop_tol=1.0,
            fill_factor=1.0,
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
        order = np.argsort(factor.perm_c)
        numbers: FloatArray = np.arange(1.0, len(self.column) + 1.0)
        places = self.matrix(numbers)
        permuted = places[order][:, order].tocsc()
        permuted.sort_indices()
        return Elimination(
            order=order,
            source=permuted.data.astype(np.int64) - 1,
            column_start=permuted.indptr,
            row_index=permuted.indices,
        )

    @cached_property
    def depth(self) -> int:
        """Steps from one end of the graph, either way, to all that it reaches; 0 for one state."""
        order, _ = scipy.sparse.csgraph.breadth_first_order(self._structure, 0, directed=False)
        steps = scipy.sparse.csgraph.dijkstra(
            self._structure, directed=False, indices=order[-1], unweighted=True
        )
        return int(steps[np.isfinite(steps)].max())


@dataclass(frozen=True, eq=False)
class EntryPattern(PolicyPattern):
    """The pattern with the place in the data of each entry of P.

    places: (nnz, S*A) matrix with a column per row of P, by columns; its numbers are replaced.
    """

    places: scipy.sparse.csc_array

    def system_data(
        self, policy: FloatArray, probabilities: FloatArray, discount: float
    ) -> FloatArray:
        """(nnz,) numbers of I - gamma P_pi for an (S, A) policy and (E,) entries."""
        data: FloatArray = with_numbers(self.places, probabilities) @ policy.ravel()
        data *= -discount
        data += self._identity
        return data

    @cached_property
    def _identity(self) -> FloatArray:
        """(nnz,) numbers of I."""
        identity = np.zeros(len(self.column))
        identity[self.diagonal] = 1.0
        return identity


@dataclass(frozen=True, eq=False)
class Elimination:
    """Reordered structure: state `order[i]` is eliminated as the i-th; `source` reorders data."""

    order: IntArray
    source: IntArray
    column_start: IntArray
    row_index: IntArray

    def matrix(self, data: FloatArray) -> scipy.sparse.csc_array:
        """(S, S) reordered matrix for data in the order of the original pattern."""
        return with_numbers(self._structure, data[self.source])

    @cached_property
    def _structure(self) -> scipy.sparse.csc_array:
        shape = (len(self.order),) * 2
        ones = np.ones(len(self.row_index))
        return scipy.sparse.csc_array((ones, self.row_index, self.column_start), shape=shape)


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

    @property
    def n_rows(self) -> int:
        """Rows of the stored band; the first `below` are room for row exchanges."""
        return 2 * self.below + self.above + 1

    def filled(self, data: FloatArray) -> FloatArray:
        """(n_rows, S) band, by columns in memory, for data in the order of the pattern."""
        flat = np.zeros(self.n_rows * len(self.order))
        flat[self.place] = data
        return flat.reshape(len(self.order), self.n_rows).T


def policy_pattern(
    row: IntArray, successor: IntArray, n_states: int, n_actions: int
) -> EntryPattern:
    """Pattern for entries with the given rows (s * n_actions + a) and successors."""
    own = np.arange(n_states, dtype=np.int64)
    keys = np.concatenate([row // n_actions * n_states + successor, own * (n_states + 1)])
    unique, place = np.unique(keys, return_inverse=True)
    row_start = np.searchsorted(unique, np.arange(n_states + 1, dtype=np.int64) * n_states)
    kind = matrix_index_type(len(keys))
    place = place.reshape(-1).astype(kind)
    ends = np.searchsorted(row, np.arange(n_states * n_actions + 1)).astype(kind)
    structure = np.ones(len(row), dtype=np.int8), place[: len(row)], ends
    shape = (len(unique), n_states * n_actions)
    return EntryPattern(
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
