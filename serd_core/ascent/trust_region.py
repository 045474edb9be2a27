"""Newton's method in a trust region, with the objective's Hessian (a second-order outer solver).

Each step maximises the quadratic model within the radius exactly, by the eigenvectors of the
Hessian (More and Sorensen 1983):

    max_p  g.p + p.H p / 2   with |p| <= radius,    (-H + mu I) p = g,   mu >= max(0, eigenvalue)

Directions without slope and curvature, such as the softmax gauge, are left alone.

For objectives that are log densities `NewtonAscent` goes to a maximum that its own step certifies:
with M = -H, the length sqrt(g . M^-1 g) of the Newton step counts standard errors, in any units.
M must be positive too, and the step short in the numbers' own scale: where data are separable, the
information fades as fast as the gradient (Albert and Anderson, Biometrika 71, 1984).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import (
    AT_MAXIMUM,
    Ascent,
    AscentResult,
    Climb,
    Objective,
    Point,
    StepCallback,
    vanishing,
)

SHRINK, GROW, ACCEPT = 0.25, 2.0, 1e-4
#: Relative size below which an eigenvalue, or a slope, counts as zero.
FLAT, LEVEL = 1e-12, 1e-10
#: Gains below this share of the objective are lost in rounding.
ROUNDING = 1e-14
#: Radius below which steps are lost in rounding.
SHORTEST_RADIUS = 1e-13
NO_ROOM = "not converged: steps became too short, at a kink or by rounding"
#: Longest step, in standard errors and in the numbers' own scale, of a point that is a maximum.
SHORT, STILL = 1e-7, 1e-3
#: Share to which a step shrinks the Newton step, and its quality, where its Hessian is kept.
KEEP, GOOD = 0.1, 0.5


@dataclass(frozen=True)
class TrustRegion(Ascent):
    """Few, expensive steps by the Hessian: the ascent for problems where L-BFGS takes thousands.

    It has converged where the largest gradient entry is at most `gradient_tolerance`. Radii are
    lengths of steps in the units of the parameters.

        fit = sc.fit_mdce_serd(problem, decisions, rng=rng, ascent=sc.TrustRegion(1e-9))
    """

    gradient_tolerance: float = 1e-6
    max_steps: int = 500
    initial_radius: float = 1.0
    largest_radius: float = 100.0

    def tries(self, climb: Climb) -> Iterator[None]:
        """Try steps by the Hessian of each point, until the radius is too short."""
        climb.judge(*vanishing(climb.here, self.gradient_tolerance))
        climb.stalled, radius, curve = NO_ROOM, self.initial_radius, None
        yield
        while True:
            curve = curve or Curvature.at(climb.objective, climb.here)
            trial = curve.trial(climb, radius)
            radius = trial.next_radius(radius, self.largest_radius)
            if radius < SHORTEST_RADIUS:
                return
            if trial.quality >= ACCEPT:
                climb.accept(trial.point, *vanishing(trial.point, self.gradient_tolerance))
                curve = None
            yield


def quadratic_step(
    gradient: FloatArray, curvatures: FloatArray, directions: FloatArray, radius: float
) -> FloatArray:
    """(n,) maximiser of the quadratic model within the radius."""
    slopes = directions.T @ gradient
    slopes = np.where(np.abs(slopes) > LEVEL * np.max(np.abs(slopes), initial=0.0), slopes, 0.0)
    scale = max(1.0, float(np.max(np.abs(curvatures), initial=0.0)))
    least = max(0.0, -float(curvatures.min(initial=0.0))) + FLAT * scale
    step = slopes / (curvatures + least)
    if np.linalg.norm(step) > radius:
        shift = _shift(slopes, curvatures, radius, least)
        step = slopes / (curvatures + shift)
    return np.asarray(directions @ step)


def _shift(slopes: FloatArray, curvatures: FloatArray, radius: float, low: float) -> float:
    """mu for which the step is as long as the radius, by bisection of its logarithm."""
    high = low + float(np.linalg.norm(slopes)) / radius + float(np.max(np.abs(curvatures)))
    for _ in range(100):
        middle = np.sqrt(low * high)
        if np.linalg.norm(slopes / (curvatures + middle)) > radius:
            low = middle
        else:
            high = middle
        if high <= low * (1.0 + 1e-10):
            break
    return high


class Trial(NamedTuple):
    """A step that was tried: where it leads, its length, and its gain over the predicted gain."""

    point: Point
    length: float
    quality: float

    def next_radius(self, radius: float, largest_radius: float) -> float:
        """The radius after a step that was tried within that one."""
        if not self.quality > SHRINK:
            return SHRINK * min(radius, self.length)
        grows = self.quality > 0.75 and self.length > 0.8 * radius
        return min(GROW * radius, largest_radius) if grows else radius


@dataclass(frozen=True, eq=False)
class NewtonStep:
    """The Newton step from a point, over n numbers of comparable scale.

    standard_errors: its length; move: (n,) the step itself.
    flat: (f, n) directions without information; rising: (r, n) those of negative information.
    """

    standard_errors: float
    move: FloatArray
    flat: FloatArray
    rising: FloatArray

    def at_maximum(self, short: float = SHORT) -> bool:
        """Whether the point is a maximum, and the only one around."""
        still = self.standard_errors <= short and bool(np.all(np.abs(self.move) <= STILL))
        return still and not len(self.flat) and not len(self.rising)


@dataclass(frozen=True, eq=False)
class Curvature:
    """Eigenvalues (n,) and eigenvectors of minus a Hessian; own: whether of the present point."""

    values: FloatArray
    vectors: FloatArray
    own: bool = True

    @classmethod
    def at(cls, objective: Objective, point: Point) -> "Curvature":
        """The curvature of an objective at a point."""
        return cls(*np.linalg.eigh(-objective.hessian(point.vector)))

    def trial(self, climb: Climb, radius: float) -> Trial:
        """Try the best step within the radius."""
        here = climb.here
        step = quadratic_step(here.gradient, self.values, self.vectors, radius)
        there, along = climb.evaluate(here.vector + step), self.vectors.T @ step
        predicted = float(here.gradient @ step - 0.5 * np.sum(self.values * along**2))
        gain = there.value - here.value
        if not np.isfinite(gain):
            quality = -np.inf
        elif abs(predicted) <= ROUNDING * max(1.0, abs(here.value)):
            quality = 1.0 if there.gradient_norm < here.gradient_norm else -np.inf
        else:
            quality = gain / predicted
        return Trial(there, float(np.linalg.norm(step)), quality)

    def newton(self, gradient: FloatArray) -> NewtonStep:
        """The Newton step from a point with that gradient (n,)."""
        size = float(np.max(np.abs(self.values), initial=0.0))
        known = self.values > FLAT * size
        curvatures, slopes = self.values[known], self.vectors[:, known].T @ gradient
        # Where all of a curved surface is flat, what is left of the gradient bends it by as much.
        rising = self.values < -FLAT * size - np.linalg.norm(gradient)
        return NewtonStep(
            standard_errors=float(np.sqrt(np.sum(slopes**2 / curvatures))),
            move=self.vectors[:, known] @ (slopes / curvatures),
            flat=self.vectors[:, ~(known | rising)].T,
            rising=self.vectors[:, rising].T,
        )


@dataclass(frozen=True)
class NewtonAscent(Ascent):
    """An ascent of log densities (not means), in a trust region until the Newton step is short.

    short: longest Newton step of a maximum, in standard errors, which the gradient norm of the
    result is. Radii are lengths of steps in the units of the parameters.
    """

    tolerance = "short"
    short: float = SHORT
    max_steps: int = 200
    initial_radius: float = 4.0
    largest_radius: float = 100.0

    def maximise(
        self,
        objective: Objective,
        start: FloatArray,
        on_step: StepCallback | None = None,
        information: FloatArray | None = None,
    ) -> AscentResult:
        """Climb from `start` (n,) to a maximum, unless `on_step` stops it or steps run out.

        information: (n, n) estimate of minus the Hessian at the start; None computes it.
        """
        climb = Climb(objective, on_step, np.array(start, dtype=np.float64))
        climb.follow(self.tries(climb, information), self.max_steps)
        found = climb.result()
        return replace(found, newton_decrement=found.gradient_norm)

    def tries(self, climb: Climb, information: FloatArray | None = None) -> Iterator[None]:
        """Try steps, whose Hessian is kept while they shrink the Newton step well."""
        given = None if information is None else Curvature(*np.linalg.eigh(information), own=False)
        curve, newton = self._at(climb, climb.here, given, np.inf)
        climb.stalled, radius = NO_ROOM, self.initial_radius
        climb.judge(*self._judged(newton))
        yield
        while radius >= SHORTEST_RADIUS:
            trial = curve.trial(climb, radius)
            if curve.own or trial.quality >= GOOD:
                radius = trial.next_radius(radius, self.largest_radius)
                if trial.quality >= ACCEPT:
                    curve, newton = self._at(climb, trial.point, curve, newton.standard_errors)
                    climb.accept(trial.point, *self._judged(newton))
            else:
                curve, newton = self._at(climb, climb.here, None, np.inf)
                climb.judge(*self._judged(newton))
            yield

    def _judged(self, newton: NewtonStep) -> tuple[float, str]:
        return newton.standard_errors, AT_MAXIMUM if newton.at_maximum(self.short) else ""

    def _at(
        self, climb: Climb, point: Point, kept: Curvature | None, before: float
    ) -> tuple[Curvature, NewtonStep]:
        """The kept curvature where it still shrinks steps well, otherwise that of the point."""
        if kept is not None:
            newton = kept.newton(point.gradient)
            shrinks = newton.standard_errors <= KEEP * before and not len(newton.rising)
            if shrinks and not newton.at_maximum(self.short):
                return replace(kept, own=False), newton
        own = Curvature.at(climb.objective, point)
        return own, own.newton(point.gradient)
