"""Newton's method in a trust region, with the objective's Hessian (a second-order outer solver).

Each step maximises the quadratic model within the radius exactly, by the eigenvectors of the
Hessian (More and Sorensen 1983):

    max_p  g.p + p.H p / 2   with |p| <= radius,    (-H + mu I) p = g,   mu >= max(0, eigenvalue)

Directions without slope and curvature, such as the softmax gauge, are left alone. A learning
problem that costs L-BFGS thousands of gradients takes about twenty such steps.

For objectives that are log densities `NewtonAscent` goes to a maximum that its own step certifies.
With the gradient g and the information M = -H of a log density, the Newton step M^-1 g leads to the
maximum. Its length sqrt(g . M^-1 g) counts standard errors, whatever units the numbers have, and
bounds how many of its own each number is off (`serd_core.uncertainty.standard_errors`). A maximum
needs more: M is positive, no direction is without information, and the step is short in the
numbers' own scale too. Where data are separable, as choices that all agree are, the information
fades as fast as the gradient: the step measured in standard errors shrinks, and yet every step is
as long as the one before (Albert and Anderson, Biometrika 71, 1984).

A Hessian may cost many evaluations. So while steps shrink the Newton step well they keep the last
Hessian; a maximum is certified by its own.
"""

from dataclasses import dataclass, replace

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import (
    OUT_OF_STEPS,
    Ascent,
    AscentResult,
    Climb,
    Objective,
    Point,
    StepCallback,
    require_limits,
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
    """Few, expensive steps; converged where the largest gradient entry is within the tolerance."""

    gradient_tolerance: float = 1e-6
    max_steps: int = 500
    initial_radius: float = 1.0
    largest_radius: float = 100.0

    def __post_init__(self) -> None:
        require_limits(self.gradient_tolerance, self.max_steps)

    def maximise(
        self, objective: Objective, start: FloatArray, on_step: StepCallback | None = None
    ) -> AscentResult:
        """Climb until the gradient vanishes, the callback stops, or steps or radius run out."""
        climb = Climb(objective, on_step)
        here = climb.evaluate(np.array(start, dtype=np.float64))
        radius, tries, eigen = self.initial_radius, 0, None
        while here.gradient_norm > self.gradient_tolerance and not climb.stopped:
            if tries >= self.max_steps:
                return climb.result(here, self.gradient_tolerance, OUT_OF_STEPS)
            tries += 1
            if eigen is None:
                eigen = np.linalg.eigh(-objective.hessian(here.vector))
            step = quadratic_step(here.gradient, eigen.eigenvalues, eigen.eigenvectors, radius)
            there = climb.evaluate(here.vector + step)
            quality = step_quality(here, there, step, eigen.eigenvalues, eigen.eigenvectors)
            radius = self.next_radius(radius, quality, float(np.linalg.norm(step)))
            if radius < SHORTEST_RADIUS:
                break
            if quality >= ACCEPT:
                here, eigen = there, None
                climb.accept(here)
        return climb.result(here, self.gradient_tolerance, NO_ROOM)

    def next_radius(self, radius: float, quality: float, length: float) -> float:
        """The radius after a step of that quality and length."""
        if not quality > SHRINK:
            return SHRINK * min(radius, length)
        if quality > 0.75 and length > 0.8 * radius:
            return min(GROW * radius, self.largest_radius)
        return radius


def quadratic_step(
    gradient: FloatArray, curvatures: FloatArray, directions: FloatArray, radius: float
) -> FloatArray:
    """(n,) maximiser of the quadratic model within the radius.

    curvatures, directions: eigenvalues and eigenvectors of minus the Hessian.
    """
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


def step_quality(
    here: Point, there: Point, step: FloatArray, curvatures: FloatArray, directions: FloatArray
) -> float:
    """Gain over predicted gain; where both drown in rounding, whether the gradient shrank."""
    along = directions.T @ step
    predicted = float(here.gradient @ step - 0.5 * np.sum(curvatures * along**2))
    gain = there.value - here.value
    if not np.isfinite(gain):
        return -np.inf
    if abs(predicted) <= ROUNDING * max(1.0, abs(here.value)):
        return 1.0 if there.gradient_norm < here.gradient_norm else -np.inf
    return gain / predicted


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
        """Whether the point is a maximum, and the only one around.

        short: longest step in standard errors.
        """
        still = self.standard_errors <= short and bool(np.all(np.abs(self.move) <= STILL))
        return still and not len(self.flat) and not len(self.rising)


@dataclass(frozen=True, eq=False)
class Curvature:
    """Eigenvalues (n,) and eigenvectors of minus a Hessian; own: whether of the present point."""

    values: FloatArray
    vectors: FloatArray
    own: bool = True

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
    """Steps of a trust region until the Newton step is short; for log densities (not means).

    short: longest Newton step of a maximum, in standard errors, which the gradient norm of the
    result is.
    """

    short: float = SHORT
    max_steps: int = 200
    initial_radius: float = 4.0
    largest_radius: float = 100.0

    def __post_init__(self) -> None:
        require_limits(self.short, self.max_steps)

    def maximise(
        self,
        objective: Objective,
        start: FloatArray,
        on_step: StepCallback | None = None,
        information: FloatArray | None = None,
    ) -> AscentResult:
        """Climb until at a maximum, the callback stops, or steps or radius run out.

        information: (n, n) estimate of minus the Hessian at the start; None computes it.
        """
        climb = Climb(objective, on_step)
        here = climb.evaluate(np.array(start, dtype=np.float64))
        given = None if information is None else Curvature(*np.linalg.eigh(information), own=False)
        curve, newton = self._at(objective, here, given, np.inf)
        region = TrustRegion(largest_radius=self.largest_radius)
        radius, tries = self.initial_radius, 0
        while not (newton.at_maximum(self.short) or climb.stopped or radius < SHORTEST_RADIUS):
            if tries >= self.max_steps:
                return climb.certified(here, newton.standard_errors, False, OUT_OF_STEPS)
            tries += 1
            step = quadratic_step(here.gradient, curve.values, curve.vectors, radius)
            there = climb.evaluate(here.vector + step)
            quality = step_quality(here, there, step, curve.values, curve.vectors)
            if not (curve.own or quality >= GOOD):
                curve, newton = self._at(objective, here, None, np.inf)
                continue
            radius = region.next_radius(radius, quality, float(np.linalg.norm(step)))
            if quality >= ACCEPT:
                here = there
                curve, newton = self._at(objective, here, curve, newton.standard_errors)
                climb.accept(here, newton.standard_errors)
        return climb.certified(here, newton.standard_errors, newton.at_maximum(self.short), NO_ROOM)

    def _at(
        self, objective: Objective, here: Point, kept: Curvature | None, before: float
    ) -> tuple[Curvature, NewtonStep]:
        """The kept curvature where it still shrinks steps well, otherwise that of the point."""
        if kept is not None:
            newton = kept.newton(here.gradient)
            shrinks = newton.standard_errors <= KEEP * before and not len(newton.rising)
            if shrinks and not newton.at_maximum(self.short):
                return replace(kept, own=False), newton
        own = Curvature(*np.linalg.eigh(-objective.hessian(here.vector)))
        return own, own.newton(here.gradient)
