"""Plain gradient ascent as printed in Algorithm 1: theta <- theta + alpha(t) grad J.

Here for comparison, and slow: SERD on 25 cells of the gridworld takes 13,081 steps of size 1 to a
gradient of 1e-6, more of any smaller or decreasing size, and 6 of the trust region.
"""

from collections.abc import Callable
from dataclasses import dataclass

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
)

DIVERGED = (
    "not converged: a step reached a point where the objective is not finite; use smaller steps"
)
TOO_LONG = f"{OUT_OF_STEPS}; the objective fell on the way, use a smaller step_size"


def constant_step(_: int) -> float:
    """A step size of one for every step."""
    return 1.0


@dataclass(frozen=True)
class GradientAscent(Ascent):
    """Steps along the gradient; step_size: alpha(t) for t = 1, 2, ... on the mean objective."""

    step_size: Callable[[int], float] = constant_step
    gradient_tolerance: float = 1e-6
    max_steps: int = 100_000

    def maximise(
        self, objective: Objective, start: FloatArray, on_step: StepCallback | None = None
    ) -> AscentResult:
        """Step until the gradient vanishes, the callback stops, steps run out or one diverges.

        The result is the last point where value and gradient were finite.
        """
        climb, otherwise = Climb(objective, on_step), OUT_OF_STEPS
        here = climb.evaluate(np.array(start, dtype=np.float64))
        while not (here.gradient_norm <= self.gradient_tolerance or climb.stopped):
            if len(climb.trace) >= self.max_steps:
                if climb.trace and here.value < max(climb.trace):
                    otherwise = TOO_LONG
                break
            size = self.step_size(len(climb.trace) + 1)
            there = _finite_point(climb, here.vector + size * here.gradient)
            if there is None:
                otherwise = DIVERGED
                break
            here = there
            climb.accept(here)
        return climb.result(here, self.gradient_tolerance, otherwise)


def _finite_point(climb: Climb, vector: FloatArray) -> Point | None:
    """The objective at a vector, or None where vector, value or gradient is not finite."""
    if not np.all(np.isfinite(vector)):
        return None
    with np.errstate(over="ignore", invalid="ignore"):
        there = climb.evaluate(vector)
    finite = np.isfinite(there.value) and np.all(np.isfinite(there.gradient))
    return there if finite else None
