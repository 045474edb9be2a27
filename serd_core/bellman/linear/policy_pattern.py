"""Symbolic structure of the S x S matrix I - gamma P_pi, the same for every policy.

    P_pi[s, s'] = sum_a pi(a | s) P(s' | s, a)

The matrix is stored by columns (CSC). Only its numbers change between solves, so positions are
computed once per MDP and each matrix costs one weighted count over the entries.
"""

import copy
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse
import scipy.sparse.csgraph
import scipy.sparse.linalg

from serd_core.arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class PolicyPattern:
    """Places of the non-zeros of I - gamma P_pi.

    row_of_entry, position: (E,) row (s, a) and place in the data of each entry of P.
    diagonal: (S,) places of the diagonal; column_start (S + 1,), row_index (nnz,): CSC structure.
    """

    row_of_entry: IntArray
    position: IntArray
    diagonal: IntArray
    column_start: IntArray
    row_index: IntArray

    @property
    def n_states(self) -> int:
        """Number of states S."""
        return len(self.diagonal)

    def system_data(self, policy: FloatArray, entries: FloatArray, discount: float) -> FloatArray:
        """(nnz,) numbers of I - gamma P_pi for an (S, A) policy and (E,) entries."""
        weights = np.take(policy.ravel(), self.row_of_entry)
        weights *= entries
        flow = np.bincount(self.position, weights=weights, minlength=len(self.row_index))
        data = np.asarray(flow, dtype=np.float64) * -discount
        data[self.diagonal] += 1.0
        return data

    def matrix(self, data: FloatArray) -> scipy.sparse.csc_array:
        """(S, S) matrix with the given numbers."""
        return with_numbers(self._structure, data)

    @cached_property
    def _structure(self) -> scipy.sparse.csc_array:
        return _square_structure(self.row_index, self.column_start)

    @cached_property
    def band(self) -> "Band":
        """The pattern reordered symmetrically for a narrow band, found once."""
        matrix = self.matrix(np.ones(len(self.row_index)))
        order = scipy.sparse.csgraph.reverse_cuthill_mckee(matrix.tocsr(), symmetric_mode=False)
        rank = np.argsort(order)
        column = np.repeat(np.arange(self.n_states), np.diff(self.column_start))
        return _band(np.asarray(order, dtype=np.int64), rank, rank[self.row_index], rank[column])

    @cached_property
    def elimination(self) -> "Elimination":
        """The pattern reordered symmetrically for little fill (minimum degree), found once."""
        # Off-diagonals of -1/degree make the sample matrix diagonally dominant, like every system.
        degree = np.diff(self.column_start).max()
        data = np.full(len(self.row_index), -1.0 / (degree + 1))
        data[self.diagonal] = 1.0
        factor = scipy.sparse.linalg.splu(
            self.matrix(data),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
        order = np.argsort(factor.perm_c)
        numbers: FloatArray = np.arange(1.0, len(self.row_index) + 1.0)
        places = self.matrix(numbers)
        permuted = places[order][:, order].tocsc()
        permuted.sort_indices()
        return Elimination(
            order=order,
            source=permuted.data.astype(np.int64) - 1,
            column_start=permuted.indptr,
            row_index=permuted.indices,
        )


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
        return _square_structure(self.row_index, self.column_start)


@dataclass(frozen=True, eq=False)
class Band:
    """Reordered structure as LAPACK stores bands: entry (i, j) in row below + above + i - j.

    State `order[i]` is the i-th unknown and `rank` the inverse; below, above: diagonals on either
    side of the main one; place: (nnz,) position of each number of the pattern in the flat band.
    """

    order: IntArray
    rank: IntArray
    below: int
    above: int
    place: IntArray

    @property
    def n_rows(self) -> int:
        """Rows of the stored band; the first `below` are room for row exchanges."""
        return 2 * self.below + self.above + 1

    def filled(self, data: FloatArray) -> FloatArray:
        """(n_rows, S) band, by columns in memory, for data in the order of the pattern."""
        flat = np.zeros(self.n_rows * len(self.order))
        flat[self.place] = data
        return flat.reshape(len(self.order), self.n_rows).T


def _square_structure(row_index: IntArray, column_start: IntArray) -> scipy.sparse.csc_array:
    n_states = len(column_start) - 1
    ones = np.ones(len(row_index))
    return scipy.sparse.csc_array((ones, row_index, column_start), shape=(n_states, n_states))


def _band(order: IntArray, rank: IntArray, row: IntArray, column: IntArray) -> Band:
    below, above = int(np.max(row - column)), int(np.max(column - row))
    n_rows = 2 * below + above + 1
    place = column * n_rows + below + above + row - column
    return Band(order=order, rank=rank, below=below, above=above, place=place)


def policy_pattern(
    row: IntArray, successor: IntArray, n_states: int, n_actions: int
) -> PolicyPattern:
    """Pattern for entries with the given rows (s * n_actions + a) and successors."""
    own = np.arange(n_states, dtype=np.int64)
    keys = np.concatenate([successor * n_states + row // n_actions, own * (n_states + 1)])
    unique, place = np.unique(keys, return_inverse=True)
    column_start = np.searchsorted(unique, np.arange(n_states + 1, dtype=np.int64) * n_states)
    place = place.reshape(-1)
    return PolicyPattern(
        row_of_entry=row,
        position=place[: len(row)],
        diagonal=place[len(row) :],
        column_start=column_start.astype(np.int32),
        row_index=(unique % n_states).astype(np.int32),
    )


def with_numbers(
    structure: scipy.sparse.csr_array | scipy.sparse.csc_array, numbers: FloatArray
) -> scipy.sparse.csr_array | scipy.sparse.csc_array:
    """A matrix that shares the index arrays of `structure` and has the given (nnz,) numbers."""
    matrix = copy.copy(structure)
    matrix.data = numbers
    return matrix
