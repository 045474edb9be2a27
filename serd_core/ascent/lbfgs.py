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
        run = _Run(climb, climb.evaluate(np.array(start, dtype=np.float64)))
        reason = ""
        for _ in range(2):
            if not (climb.stopped or self._done(run)):
                reason = self._minimise(run)
        out = len(climb.trace) >= self.max_steps
        otherwise = OUT_OF_STEPS if out else f"not converged: {reason}"
        found = climb.result(run.here, self.gradient_tolerance, otherwise)
        return replace(found, by_rounding=not (found.converged or climb.stopped or out))

    def _done(self, run: "_Run") -> bool:
        out = len(run.climb.trace) >= self.max_steps
        return run.here.gradient_norm <= self.gradient_tolerance or out

    def _minimise(self, run: "_Run") -> str:
        result = scipy.optimize.minimize(
            run.negated,
            run.here.vector,
            jac=True,
            method="L-BFGS-B",
            callback=run.after_step,
            options={
                "maxiter": self.max_steps - len(run.climb.trace),
                "maxfun": 20 * self.max_steps,
                "maxcor": self.memory,
                "gtol": self.gradient_tolerance,
                "ftol": 0.0,
                "maxls": 40,
            },
        )
        run.move_to(np.asarray(result.x))
        return str(result.message)


@dataclass(eq=False)
class _Run:
    """The last point that was evaluated: scipy's callback does not pass the gradient on."""

    climb: Climb
    here: Point

    def negated(self, vector: FloatArray) -> tuple[float, FloatArray]:
        self.move_to(vector)
        return -self.here.value, -self.here.gradient

    def move_to(self, vector: FloatArray) -> None:
        """Evaluate at `vector` unless that was the last evaluation."""
        if not np.array_equal(vector, self.here.vector):
            self.here = self.climb.evaluate(vector.copy())

    def after_step(self, intermediate_result: scipy.optimize.OptimizeResult) -> None:
        self.move_to(np.asarray(intermediate_result.x))
        self.climb.accept(self.here)
        if self.climb.stopped:
            raise StopIteration


LBFGS = Lbfgs()
