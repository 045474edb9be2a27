"""Plain gradient ascent as printed in Algorithm 1: theta <- theta + alpha(t) grad J."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import (
    CONVERGED,
    OUT_OF_STEPS,
    STOPPED,
    Ascent,
    AscentResult,
    Objective,
    Step,
    StepObserver,
    largest,
    require_limits,
)


def constant_step(_: int) -> float:
    """A step size of one, whatever the step."""
    return 1.0


@dataclass(frozen=True)
class GradientAscent(Ascent):
    """Steps along the gradient; step_size: alpha(t) for t = 1, 2, ... on the mean objective."""

    step_size: Callable[[int], float] = constant_step
    gradient_tolerance: float = 1e-6
    max_steps: int = 100_000

    def __post_init__(self) -> None:
        require_limits(self.gradient_tolerance, self.max_steps)

    def maximise(
        self, objective: Objective, start: FloatArray, observer: StepObserver
    ) -> AscentResult:
        """Step until the gradient vanishes, the observer stops or steps run out."""
        vector = np.array(start, dtype=np.float64)
        value, gradient = objective.evaluate(vector)
        trace: list[float] = []
        stopped = False
        while largest(gradient) > self.gradient_tolerance and len(trace) < self.max_steps:
            vector = vector + self.step_size(len(trace) + 1) * gradient
            value, gradient = objective.evaluate(vector)
            trace.append(value)
            step = Step(len(trace), value, largest(gradient), len(trace) + 1, vector)
            if stopped := observer(step):
                break
        converged = largest(gradient) <= self.gradient_tolerance
        return AscentResult(
            vector=vector,
            objective=value,
            gradient_norm=largest(gradient),
            n_steps=len(trace),
            n_evaluations=len(trace) + 1,
            converged=converged,
            message=_message(converged, stopped),
            objective_trace=np.array(trace),
        )


def _message(converged: bool, stopped: bool) -> str:
    if converged:
        return CONVERGED
    return STOPPED if stopped else OUT_OF_STEPS
