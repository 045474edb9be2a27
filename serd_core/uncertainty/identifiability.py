"""What the data at hand cannot tell: null directions of the information matrix.

Along a null direction all free numbers can move together without changing the likelihood. Gauge
directions, which change no probability at all, are taken out first. Estimating rewards and
dynamics at once is not identifiable in general without priors; whether it is for given data is a
property of this matrix, shown here by name.
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.uncertainty.information import Information

#: Eigenvalues below this share of the largest count as zero.
NULL_SHARE = 1e-9


@dataclass(frozen=True, eq=False)
class NullDirection:
    """A direction without information: its eigenvalue and what moves along it, largest first."""

    eigenvalue: float
    loadings: tuple[tuple[str, float], ...]

    def __str__(self) -> str:
        parts = [f"{weight:+.2f} {name}" for name, weight in self.loadings]
        return " ".join(parts)


@dataclass(frozen=True, eq=False)
class Identifiability:
    """eigenvalues: of the information with the gauge taken out, ascending; null: directions."""

    eigenvalues: FloatArray
    null: tuple[NullDirection, ...]

    @property
    def identified(self) -> bool:
        """Whether the data tell every free number."""
        return not self.null


def identifiability(
    information: Information, *, matrix: FloatArray | None = None, null_share: float = NULL_SHARE
) -> Identifiability:
    """Diagnose a matrix over the free numbers; by default the outer product (likelihood only)."""
    chosen = information.outer_product if matrix is None else matrix
    basis = gauge_free_basis(information)
    values, vectors = np.linalg.eigh(basis.T @ chosen @ basis)
    limit = null_share * max(float(values[-1]), np.finfo(np.float64).tiny)
    directions = (basis @ vectors).T
    null = tuple(
        NullDirection(float(value), _loadings(information.names, direction))
        for value, direction in zip(values, directions, strict=True)
        if value <= limit
    )
    return Identifiability(eigenvalues=values, null=null)


def gauge_free_basis(information: Information) -> FloatArray:
    """(n, n - g) orthonormal basis of what is orthogonal to the gauge."""
    n_gauge, n_free = information.gauge.shape
    complete = np.linalg.qr(np.concatenate([information.gauge, np.eye(n_free)]).T, mode="reduced").Q
    return np.asarray(complete[:, n_gauge:n_free])


def _loadings(
    names: tuple[str, ...], direction: FloatArray, share: float = 0.1
) -> tuple[tuple[str, float], ...]:
    order = np.argsort(-np.abs(direction), kind="stable")
    largest = abs(direction[order[0]])
    return tuple(
        (names[i], float(direction[i])) for i in order if abs(direction[i]) >= share * largest
    )
