"""The most likely distribution of one outcome model, by Newton's method, with its certificate.

    sum_g n_g log sum_{k in g} P(k)  +  c sum_k log P(k),   sum_k P(k) = 1

g is a set of outcomes that would all explain an observation. In relative moves x(k) = dP(k) / P(k),
with q_g the shares of an observation's outcomes and r = c + sum_g n_g q_g,

    A x = r - t P,   A = c I + sum_g n_g q_g q_g^T,   t such that sum_k P(k) x(k) = 0

A sum of logarithms that weigh at least m = min(1, c) is m times a self-concordant one. So where
the decrement d = sqrt(x^T A x / m) is below 1, every P(k) is within a share d / (1 - d) of its
most likely value (Nesterov and Nemirovskii, 1994). A small move alone would not say so.
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray

EPSILON = float(np.finfo(np.float64).eps)
#: Share of what its slope promises that a step must gain, and the shortest step tried.
ENOUGH, SHORTEST_STEP = 0.25, 1e-12
#: Share of a probability that rounding may decide before an estimate is none.
LARGEST_ROUNDING = 0.5


@dataclass(frozen=True, eq=False)
class DynamicsEstimate:
    """probabilities: (M, K); Newton steps of the model that took most.

    error_bound: share of itself by which a probability may be off; converged: it is within the
    tolerance, or within what rounding allows.
    """

    probabilities: FloatArray
    steps: int
    error_bound: float
    converged: bool


@dataclass(frozen=True, eq=False)
class OutcomeCounts:
    """The objective of one model: (G, K) sets of outcomes, (G,) counts and c."""

    explaining: FloatArray
    counts: FloatArray
    pseudo_count: float

    @property
    def total(self) -> float:
        """All observations and pseudo-observations."""
        return float(self.counts.sum() + self.pseudo_count * self.explaining.shape[1])

    def objective(self, probabilities: FloatArray) -> float:
        """What is maximised, at (K,) positive probabilities."""
        observed = float(self.counts @ np.log(self.explaining @ probabilities))
        return observed + self.pseudo_count * float(np.sum(np.log(probabilities)))

    def newton(self, probabilities: FloatArray) -> tuple[FloatArray, float, float]:
        """(K,) relative move x, x^T A x, and the slope of the objective along x."""
        shares = self.explaining * probabilities / (self.explaining @ probabilities)[:, None]
        wanted = self.pseudo_count + self.counts @ shares
        curvature = (shares * self.counts[:, None]).T @ shares
        curvature[np.diag_indices_from(curvature)] += self.pseudo_count
        both = np.stack([wanted - self.total * probabilities, probabilities], axis=1)
        by_slope, by_sum = np.linalg.solve(curvature, both).T
        move = by_slope - (probabilities @ by_slope) / (probabilities @ by_sum) * by_sum
        return move, float(move @ curvature @ move), float(move @ both[:, 0])


def maximum_of(
    counts: OutcomeCounts, probabilities: FloatArray, tolerance: float, max_steps: int
) -> DynamicsEstimate:
    """Damped Newton steps from (K,) probabilities until the decrement certifies the tolerance."""
    n_outcomes = len(probabilities)
    weight = min(1.0, counts.pseudo_count)
    # A slope is rounded to some units of the total; the curvature is at least the pseudo-count.
    least = float(np.sqrt(counts.pseudo_count) * np.sqrt(weight))
    rounding = (n_outcomes + 3) * EPSILON * counts.total / least
    bound = np.inf
    if rounding > LARGEST_ROUNDING:
        # The pseudo-count is lost in the counts and does not tell hidden outcomes apart.
        return DynamicsEstimate(probabilities, 0, bound, converged=False)
    for step in range(1, max_steps + 1):
        move, size, slope = counts.newton(probabilities)
        decrement = float(np.sqrt(size / weight))
        # From 1/3 on, the step that follows lowers the decrement, so the bound holds after it.
        bound = decrement / (1.0 - decrement) if decrement <= 1.0 / 3.0 else np.inf
        probabilities = _moved(counts, probabilities, move, slope)
        if bound <= max(tolerance, rounding):
            return DynamicsEstimate(probabilities, step, max(bound, rounding), converged=True)
    return DynamicsEstimate(probabilities, max_steps, bound, converged=False)


def _moved(
    counts: OutcomeCounts, probabilities: FloatArray, move: FloatArray, slope: float
) -> FloatArray:
    """Probabilities after the longest of steps 1, 1/2, 1/4, ... that gains what it should."""
    before, length = counts.objective(probabilities), 1.0
    # Close to the maximum gains drown in rounding, and full steps are right.
    lost = 4.0 * EPSILON * (abs(before) + counts.total)
    while length > SHORTEST_STEP:
        there = probabilities * (1.0 + length * move)
        if np.all(there > 0.0):
            gain = counts.objective(there) - before
            if gain >= ENOUGH * length * slope - lost:
                return np.asarray(there / there.sum())
        length *= 0.5
    return probabilities
