"""The inverse of an information matrix, infinite where that is singular."""

import numpy as np

from serd_core.arrays import FloatArray

#: Eigenvalue of the correlation form of the information below which weights are not determined.
SINGULAR = 1e-12


def covariance_of(information: FloatArray) -> FloatArray:
    """(F, F) inverse by the correlation form; infinite in all entries where that is singular."""
    size = np.diag(information)
    if np.all(size > 0):
        scale = np.outer(1.0 / np.sqrt(size), 1.0 / np.sqrt(size))
        correlation = information * scale
        if np.linalg.eigvalsh(correlation)[0] > SINGULAR:
            return np.asarray(np.linalg.inv(correlation) * scale)
    return np.full_like(information, np.inf)
