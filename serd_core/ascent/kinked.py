"""Ascent of objectives with kinks, such as likelihoods of policies over optimal Q-values.

Where the greedy policy changes, the gradient of PM SERD jumps, and its maxima often lie just there.
This ascent goes on from a smooth one with BFGS and a weak Wolfe line search (Lewis and Overton,
Mathematical Programming 141, 2013), and stops where some mean of the gradients found within a small
neighbourhood vanishes (Burke, Lewis and Overton, SIAM J. Optim. 15, 2005):

    min over shares w >= 0, sum w = 1  of  |sum_j w_j g_j|  close to 0

Where no step gains anything that mean gives the direction, and each failure adds a gradient to it.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import scipy.optimize

from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import AT_A_KINK, Ascent, Climb, Point, largest, vanishing
from serd_core.ascent.trust_region import TrustRegion

#: Weak Wolfe: a step gains this share of what its slope promises, and lowers the slope to that.
GAIN, LOWER = 1e-4, 0.9
#: Smallest curvature, relative to the largest and to 1, that a first metric is made of.
LEAST_CURVATURE = 1e-6
#: Weight of the row that makes the shares of a mean sum to one; they are normalised afterwards.
SUM_WEIGHT = 1e4
#: Trials of a line search (each halves an interval or doubles the step), and of directions.
MAX_TRIALS, MAX_DIRECTIONS = 50, 50
TINY = float(np.finfo(np.float64).tiny)
STALLED = "not converged: no step gains anything and the gradients around do not cancel"


@dataclass(frozen=True)
class KinkedAscent(Ascent):
    """The ascent of `fit_pm_serd`, whose objective has kinks: a smooth one, then BFGS to a kink.

    gradient_tolerance: for the gradient, or the smallest mean of the gradients around; around means
    within neighbourhood * max(1, |x|). The gradient norm of the result is that of this mean.
    longest_step: bound of |x - previous x|; a logarithm among x must not run away in one step.
    SerdError for a tolerance or number of steps below 0.
    """

    smooth: Ascent = field(default_factory=TrustRegion)
    gradient_tolerance: float = 1e-6
    neighbourhood: float = 1e-6
    max_steps: int = 1_000
    longest_step: float = 10.0

    def tries(self, climb: Climb) -> Iterator[None]:
        """Make the smooth ascent's tries, then steps of BFGS from where it stalled."""
        climb.follow(self.smooth.tries(climb), self.smooth.max_steps)
        if climb.over:
            return
        climb.stalled, climb.by_rounding, run = STALLED, False, _Run(climb, self)
        yield
        while True:
            there = run.step()
            norm = largest(smallest_mean(run.gradients_around()))
            _, maximum = vanishing(run.here, self.gradient_tolerance)
            maximum = maximum or (AT_A_KINK if norm <= self.gradient_tolerance else "")
            if there is None:
                climb.judge(norm, maximum)
                return
            climb.accept(there, norm, maximum)
            yield


class _Run:
    """One climb by BFGS: its current point, the inverse metric, and the points seen lately."""

    def __init__(self, climb: Climb, settings: KinkedAscent) -> None:
        self.climb, self.settings, self.here = climb, settings, climb.here
        # Longer than a line search, whose last trials would otherwise displace its first.
        size = 2 * len(self.here.vector) + 20 + MAX_TRIALS
        self.seen: deque[Point] = deque([self.here], maxlen=size)
        self.steepest_down: list[Point] = []
        self.metric = first_metric(climb.objective.hessian(self.here.vector))

    def step(self) -> Point | None:
        """The end of one BFGS step, which becomes the current point; None if nothing is gained."""
        direction = self.metric @ self.here.gradient
        there = self._search(direction, float(self.here.gradient @ direction))
        there = there or self._across_kinks()
        if there is not None:
            moved = there.vector - self.here.vector
            self.metric = updated_metric(self.metric, moved, self.here.gradient - there.gradient)
            self.here, self.steepest_down = there, []
        return there

    def _search(self, direction: FloatArray, slope: float) -> Point | None:
        """A point along the direction that meets the weak Wolfe conditions, or at least gains."""
        longest = self.settings.longest_step / max(float(np.linalg.norm(direction)), TINY)
        short, long, length, found = 0.0, np.inf, min(1.0, longest), None
        for _ in range(MAX_TRIALS):
            there = self.climb.evaluate(self.here.vector + length * direction)
            if np.isfinite(there.value):
                self.seen.append(there)
            gain = there.value - self.here.value
            if not (gain > 0.0 and there.value >= self.here.value + GAIN * length * slope):
                long = length
            elif float(there.gradient @ direction) > LOWER * slope:
                short, found = length, there
            else:
                return there
            if short >= longest:
                return found
            length = min(2.0 * short, longest) if np.isinf(long) else 0.5 * (short + long)
        return found

    def _across_kinks(self) -> Point | None:
        """A gain along the smallest mean of the gradients around, as the metric measures them."""
        self.metric = first_metric(self.climb.objective.hessian(self.here.vector))
        root = np.linalg.cholesky(self.metric)
        for _ in range(MAX_DIRECTIONS):
            mean = np.linalg.solve(root.T, smallest_mean(self.gradients_around() @ root))
            if largest(mean) <= self.settings.gradient_tolerance:
                return None
            direction = self.metric @ mean
            there = self._search(direction, float(mean @ direction))
            if there is not None:
                return there
            # Keep the gradient that made the direction fail, or the next may fail the same way.
            self.steepest_down.append(
                min(self._points_around(), key=lambda point: float(point.gradient @ direction))
            )
        return None

    def gradients_around(self) -> FloatArray:
        """(k, n) gradients seen within the neighbourhood, the present one first."""
        return np.array([point.gradient for point in self._points_around()])

    def _points_around(self) -> list[Point]:
        here = self.here.vector
        radius = self.settings.neighbourhood * max(1.0, float(np.linalg.norm(here)))
        others = [
            point
            for point in (*self.seen, *self.steepest_down)
            if point is not self.here and np.linalg.norm(point.vector - here) <= radius
        ]
        return [self.here, *others]


def first_metric(hessian: FloatArray) -> FloatArray:
    """(n, n) inverse of the Hessian's absolute value, with a floor under its curvatures."""
    values, vectors = np.linalg.eigh(hessian)
    curvature = np.abs(values)
    floor = LEAST_CURVATURE * max(float(curvature.max(initial=0.0)), 1.0)
    return np.asarray((vectors / np.maximum(curvature, floor)) @ vectors.T)


def updated_metric(metric: FloatArray, moved: FloatArray, drop: FloatArray) -> FloatArray:
    """(n, n) BFGS update for a step `moved` (n,) that lowered the gradient by `drop` (n,)."""
    curvature = float(moved @ drop)
    if not curvature > np.finfo(np.float64).eps * float(moved @ moved):
        return metric
    along = metric @ drop
    scale = (1.0 + float(drop @ along) / curvature) / curvature
    mixed = np.outer(moved, along) / curvature
    return np.asarray(metric + scale * np.outer(moved, moved) - mixed - mixed.T)


def smallest_mean(gradients: FloatArray) -> FloatArray:
    """(n,) mean of (k, n) gradients with the shares that make it shortest.

        min |sum_j w_j g_j|  over  w >= 0, sum w = 1

    as non-negative least squares with one more row for the sum.
    """
    scale = float(np.max(np.abs(gradients), initial=0.0))
    if scale == 0.0:
        return np.zeros(gradients.shape[1])
    count = len(gradients)
    table = np.vstack([gradients.T / scale, np.full(count, SUM_WEIGHT)])
    wanted = np.append(np.zeros(gradients.shape[1]), SUM_WEIGHT)
    shares, _ = scipy.optimize.nnls(table, wanted, maxiter=100 * count)
    return np.asarray((shares / shares.sum()) @ gradients)
