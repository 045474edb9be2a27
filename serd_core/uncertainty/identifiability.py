"""What the data at hand cannot tell: null directions of the information matrix (`spectrum`).

Along a null direction all free numbers can move together without changing the likelihood. Changing
the units of a feature changes neither which directions these are nor how they are told. Estimating
rewards and dynamics at once is not identifiable in general without priors; whether it is for given
data is a property of this matrix, shown here by name.
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.uncertainty.information import Information
from serd_core.uncertainty.spectrum import NULL_SHARE, spectrum


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
    """eigenvalues: of the correlation form without the gauge, ascending; null: directions."""

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
    found = spectrum(information, chosen, null_share)
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
