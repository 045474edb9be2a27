"""Plain gradient ascent as printed in Algorithm 1: theta <- theta + alpha(t) grad J.

Here for comparison, and slow: SERD on 25 cells of the gridworld takes 13,081 steps of size 1 to a
gradient of 1e-6, more of any smaller or decreasing size, and 6 of the trust region.
"""

from collections.abc import Callable, Iterator
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
    vanishing,
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

    def tries(self, climb: Climb) -> Iterator[None]:
        """Step until one diverges; the last point has a finite value and gradient."""
        climb.judge(*vanishing(climb.here, self.gradient_tolerance))
        climb.stalled = DIVERGED
        yield
        while True:
            size = self.step_size(len(climb.trace) + 1)
            there = _finite_point(climb, climb.here.vector + size * climb.here.gradient)
            if there is None:
                return
            climb.accept(there, *vanishing(there, self.gradient_tolerance))
            yield

    def maximise(
        self, objective: Objective, start: FloatArray, on_step: StepCallback | None = None
    ) -> AscentResult:
        """Climb; where steps run out, the message gives whether the objective fell on the way."""
        result = super().maximise(objective, start, on_step)
        fell = result.objective < result.objective_trace.max(initial=-np.inf)
        return (
            replace(result, message=TOO_LONG) if result.message == OUT_OF_STEPS and fell else result
        )


def _finite_point(climb: Climb, vector: FloatArray) -> Point | None:
    """The objective at a vector, or None where vector, value or gradient is not finite."""
    if not np.all(np.isfinite(vector)):
        return None
    with np.errstate(over="ignore", invalid="ignore"):
        there = climb.evaluate(vector)
    finite = np.isfinite(there.value) and np.all(np.isfinite(there.gradient))
    return there if finite else None
