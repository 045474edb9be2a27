"""Sparse matrices of one structure and changing numbers.

scipy checks and copies the structure of every matrix it makes, which for small problems takes
longer than a product with it; a structure that was checked once needs neither.
"""

import copy

import scipy.sparse

from serd_core.arrays import FloatArray


def with_numbers(
    structure: scipy.sparse.csr_array | scipy.sparse.csc_array, numbers: FloatArray
) -> scipy.sparse.csr_array | scipy.sparse.csc_array:
    """A matrix that shares the index arrays of `structure` and has the given (nnz,) numbers."""
    matrix = copy.copy(structure)
    matrix.data = numbers
    return matrix
