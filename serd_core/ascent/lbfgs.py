"""Limited-memory BFGS of scipy.optimize, stopped by the gradient and nothing weaker."""

from dataclasses import dataclass, replace

import numpy as np
import scipy.optimize

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


@dataclass(frozen=True)
class Lbfgs(Ascent):
    """L-BFGS; converged where the largest gradient entry is at most `gradient_tolerance`."""

    gradient_tolerance: float = 1e-6
    max_steps: int = 5_000
    memory: int = 30

    def __post_init__(self) -> None:
        require_limits(self.gradient_tolerance, self.max_steps)

    def maximise(
        self, objective: Objective, start: FloatArray, on_step: StepCallback | None = None
    ) -> AscentResult:
        """Climb; where the line search stalls by rounding it is restarted once."""
        climb = Climb(objective, on_step)
        here, reason = climb.evaluate(np.array(start, dtype=np.float64)), ""
        for _ in range(2):
            left = self.max_steps - len(climb.trace)
            if here.gradient_norm > self.gradient_tolerance and left > 0 and not climb.stopped:
                here, reason = self._minimise(climb, here, left)
        out = len(climb.trace) >= self.max_steps
        otherwise = OUT_OF_STEPS if out else f"not converged: {reason}"
        found = climb.result(here, self.gradient_tolerance, otherwise)
        return replace(found, by_rounding=not (found.converged or climb.stopped or out))

    def _minimise(self, climb: Climb, start: Point, max_steps: int) -> tuple[Point, str]:
        def after_step(intermediate_result: scipy.optimize.OptimizeResult) -> None:
            climb.accept(climb.evaluate(np.asarray(intermediate_result.x)))
            if climb.stopped:
                raise StopIteration

        result = scipy.optimize.minimize(
            climb.negated,
            start.vector,
            jac=True,
            method="L-BFGS-B",
            callback=after_step,
            options={
                "maxiter": max_steps,
                "maxfun": 20 * self.max_steps,
                "maxcor": self.memory,
                "gtol": self.gradient_tolerance,
                "ftol": 0.0,
                "maxls": 40,
            },
        )
        return climb.evaluate(np.asarray(result.x)), str(result.message)


LBFGS = Lbfgs()
