"""An information matrix taken apart: how much the data tell along each direction.

Free numbers have units of their own: a feature in millimetres has a weight a thousand times
smaller than in metres, and an information a million times larger. So the matrix M is first brought
into correlation form, D M D with D = diag(M)^(-1/2), which changing units leaves as it is, and its
eigenvalues, which then have no units, tell what is known. A diagonal entry that is nothing but the
rounding of larger numbers is no scale; the size of what cancelled is taken for it.

Gauge directions, which change no probability at all, are taken out.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from serd_core.arrays import FloatArray, float_array
from serd_core.uncertainty.information import Information

#: Eigenvalues below this share of the largest count as zero.
NULL_SHARE = 1e-9

# Share of the squared size of what was subtracted below which information is rounding.
_ROUNDING = 1e-13


@dataclass(frozen=True, eq=False)
class Spectrum:
    """m = n - g directions of n free numbers.

    values: (m,) eigenvalues of the correlation form, ascending; known, null: (m,) whether the data
    tell anything along each.
    loadings: (m, n) each number's part, in standard errors it would have alone.
    directions: (m, n) the same in the numbers' own units, orthogonal to the gauge.
    """

    values: FloatArray
    loadings: FloatArray
    directions: FloatArray
    null_share: float

    @property
    def null(self) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """(m,) directions without information."""
        largest = max(float(self.values[-1]), np.finfo(np.float64).tiny)
        return np.asarray(self.values <= self.null_share * largest)

    @property
    def covariance(self) -> FloatArray:
        """(n, n) inverse of the matrix on the directions that are not null."""
        known = self.directions[~self.null]
        return np.asarray((known.T / self.values[~self.null]) @ known)


def spectrum(
    information: Information, matrix: FloatArray, null_share: float = NULL_SHARE
) -> Spectrum:
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
    return Spectrum(values, loadings, own_units - own_units @ gauge.T @ gauge, null_share)


def gauge_free_basis(gauge: FloatArray) -> FloatArray:
    """(n, n - g) orthonormal basis of what is orthogonal to (g, n) gauge directions."""
    n_gauge, n_free = gauge.shape
    if not n_gauge:
        return np.eye(n_free)
    complete = scipy.linalg.qr(gauge.T, mode="full")[0]
    return np.asarray(complete[:, n_gauge:])


def _scale(information: Information, matrix: FloatArray) -> FloatArray:
    """(n,) D: the error each number would have if all others were known."""
    most = information.n_decisions * information.score_sizes**2
    own = np.abs(np.diag(matrix))
    told = np.where(own > _ROUNDING * most, own, most)
    return np.asarray(1.0 / np.sqrt(np.where(told > 0, told, 1.0)))
