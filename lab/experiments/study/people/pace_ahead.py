"""How the pace of a person ahead follows from the one that was observed."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from serd_core.arrays import FloatArray, float_array
from serd_core.arrival.dwell_times import Pace
from serd_core.errors import SerdError

#: Added to the diagonal of the equations of the line, so that they have a solution.
_RIDGE = 1e-6


@dataclass(frozen=True, eq=False)
class PaceAhead:
    """How the pace of what is ahead follows from the observed one: Normal(a + r m, variance).

    m is the posterior mean of the observed pace. r = 1 where people keep their pace, and below
    where it changes on the way.
    """

    intercept: float
    slope: float
    variance: float

    def after(self, observed: Pace) -> Pace:
        """The pace of what is ahead of a person."""
        return Pace(self.intercept + self.slope * observed.mean, self.variance)


def fit_pace_ahead(observed: FloatArray, ahead: FloatArray, noise: FloatArray) -> PaceAhead:
    """Fit to P people by maximum likelihood.

    observed: (P,) posterior means m; ahead: (P,) log of the time that the rest took over its mean
    at pace 0; noise: (P,) variance of that by chance alone, at a given pace.
    """
    first = float_array("observed", observed, (None,))
    rest = float_array("ahead", ahead, (len(first),))
    chance = float_array("noise", noise, (len(first),))
    if len(first) < 3:
        raise SerdError(f"observed must hold at least 3 people, got {len(first)}; watch more")
    design = np.stack([np.ones(len(first)), first], axis=1)

    def solved(variance: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        weight = 1.0 / (chance + variance)
        inner = design.T @ (design * weight[:, None]) + _RIDGE * np.eye(2)
        line = np.asarray(np.linalg.solve(inner, design.T @ (weight * rest)), dtype=np.float64)
        return line, rest - design @ line, weight

    def loss(log_variance: float) -> float:
        _, left, weight = solved(float(np.exp(log_variance)))
        return float(np.sum(weight * left**2 - np.log(weight)))

    found = minimize_scalar(loss, bounds=(-12.0, 2.0), method="bounded")
    variance = float(np.exp(found.x))
    line = solved(variance)[0]
    return PaceAhead(float(line[0]), float(line[1]), variance)
