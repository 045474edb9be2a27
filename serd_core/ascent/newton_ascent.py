"""Newton's method to a maximum that its own step certifies, for objectives that are log densities.

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
from serd_core.ascent.trust_region import (
    ACCEPT,
    FLAT,
    NO_ROOM,
    SHORTEST_RADIUS,
    TrustRegion,
    quadratic_step,
    step_quality,
)

#: Longest step, in standard errors and in the numbers' own scale, of a point that is a maximum.
SHORT, STILL = 1e-7, 1e-3
#: Share to which a step shrinks the Newton step, and its quality, where its Hessian is kept.
KEEP, GOOD = 0.1, 0.5


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
