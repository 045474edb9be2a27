"""What the data at hand determine: the spectrum of an information matrix and its null directions.

The matrix M is brought into correlation form, D M D with D = diag(M)^(-1/2), which changing units
leaves as it is. A diagonal entry that is nothing but the rounding of larger numbers is no scale;
the size of what cancelled is taken instead. Along a null direction all free numbers can move
together without changing the likelihood; gauge directions are taken out.
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray, float_array
from serd_core.posterior.coordinates import gauge_free_basis
from serd_core.uncertainty.information import Information, require_information

#: Eigenvalues below this share of the largest count as zero.
NULL_SHARE = 1e-9
#: Eigenvalues below minus this share of the largest are negative beyond rounding.
NEGATIVE_SHARE = 1e-6

# Share of the squared size of what was subtracted below which information is rounding.
_ROUNDING = 1e-13


@dataclass(frozen=True, eq=False)
class Spectrum:
    """m = n - g directions of n free numbers.

    values: (m,) eigenvalues of the correlation form, ascending; known, null: (m,) whether the data
    hold information along each.
    loadings: (m, n) each number's part, in standard errors it would have alone.
    directions: (m, n) the same in the numbers' own units, orthogonal to the gauge.
    """

    values: FloatArray
    loadings: FloatArray
    directions: FloatArray

    @property
    def null(self) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """(m,) directions without information."""
        largest = max(float(self.values[-1]), np.finfo(np.float64).tiny)
        return np.asarray(self.values <= NULL_SHARE * largest)

    @property
    def indefinite(self) -> bool:
        """Whether an eigenvalue is negative beyond rounding."""
        return bool(self.values[0] < -NEGATIVE_SHARE * abs(self.values[-1]))

    @property
    def covariance(self) -> FloatArray:
        """(n, n) inverse of the matrix on the directions that are not null."""
        known = self.directions[~self.null]
        return np.asarray((known.T / self.values[~self.null]) @ known)


def spectrum(information: Information, matrix: FloatArray) -> Spectrum:
    """Directions of one of the information matrices, or of another over the same numbers."""
    n_free = len(information.names)
    chosen = float_array("matrix", matrix, (n_free, n_free))
    scale = _scale(information, chosen)
    basis = gauge_free_basis(information.gauge / scale)
    correlation = chosen * scale[:, None] * scale
    values, vectors = np.linalg.eigh(basis.T @ correlation @ basis)
    loadings = (basis @ vectors).T
    gauge = information.gauge
    own_units = loadings * scale
    return Spectrum(values, loadings, own_units - own_units @ gauge.T @ gauge)


def _scale(information: Information, matrix: FloatArray) -> FloatArray:
    """(n,) D: the error each number would have if all others were known."""
    most = information.n_decisions * information.score_sizes**2
    own = np.abs(np.diag(matrix))
    squares = np.where(own > _ROUNDING * most, own, most)
    return np.asarray(1.0 / np.sqrt(np.where(squares > 0, squares, 1.0)))


@dataclass(frozen=True, eq=False)
class NullDirection:
    """A direction without information: its eigenvalue and what moves along it, largest first.

    loadings: in the standard errors that each number would have if the others were known.
    """

    eigenvalue: float
    loadings: tuple[tuple[str, float], ...]

    def __str__(self) -> str:
        parts = [f"{weight:+.2f} {name}" for name, weight in self.loadings]
        return " ".join(parts)


@dataclass(frozen=True, eq=False)
class Identifiability:
    """What decisions determine; eigenvalues: of the correlation form without the gauge, ascending;
    null: directions that they do not determine.
    """

    eigenvalues: FloatArray
    null: tuple[NullDirection, ...]

    @property
    def identified(self) -> bool:
        """Whether the data determine every free number."""
        return not self.null


def identifiability(
    information: Information, *, matrix: FloatArray | None = None
) -> Identifiability:
    """Find the combinations of numbers that the decisions of a fit do not determine.

    matrix: (n, n) information; None for the outer product, which has no prior in it.

        print(sc.identifiability(sc.fit_information(problem, decisions, fit)).null)
    """
    require_information(information)
    chosen = information.outer_product if matrix is None else matrix
    found = spectrum(information, chosen)
    null = tuple(
        NullDirection(float(value), _loadings(information.names, loadings))
        for value, loadings in zip(
            found.values[found.null], found.loadings[found.null], strict=True
        )
    )
    return Identifiability(eigenvalues=found.values, null=null)


def _loadings(
    names: tuple[str, ...], direction: FloatArray, share: float = 0.1
) -> tuple[tuple[str, float], ...]:
    order = np.argsort(-np.abs(direction), kind="stable")
    largest = abs(direction[order[0]])
    return tuple(
        (names[i], float(direction[i])) for i in order if abs(direction[i]) >= share * largest
    )
