"""Plain gradient ascent as printed in Algorithm 1: theta <- theta + alpha(t) grad J.

Here for comparison, and slow: SERD on 25 cells of the gridworld takes 13,081 steps of size 1 to a
gradient of 1e-6, more of any smaller or decreasing size, and 6 of the trust region.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import (
    CONVERGED,
    DIVERGED,
    OUT_OF_STEPS,
    STOPPED,
    Ascent,
    AscentResult,
    Objective,
    Step,
    StepObserver,
    evaluate_at,
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
        """Step until the gradient vanishes, the observer stops, steps run out or one diverges.

        The result stands at the last place where value and gradient were numbers.
        """
        vector = np.array(start, dtype=np.float64)
        value, gradient = evaluate_at(objective, vector)
        trace: list[float] = []
        message = OUT_OF_STEPS
        while not largest(gradient) <= self.gradient_tolerance and len(trace) < self.max_steps:
            there = vector + self.step_size(len(trace) + 1) * gradient
            reached = _numbers_at(objective, there)
            if reached is None:
                message = DIVERGED
                break
            vector, (value, gradient) = there, reached
            trace.append(value)
            step = Step(len(trace), value, largest(gradient), len(trace) + 1, vector)
            if observer(step):
                message = STOPPED
                break
        converged = largest(gradient) <= self.gradient_tolerance
        return AscentResult(
            vector=vector,
            objective=value,
            gradient_norm=largest(gradient),
            n_steps=len(trace),
            n_evaluations=len(trace) + 1 + (message == DIVERGED),
            converged=converged,
            message=CONVERGED if converged else _explained(message, value, trace),
            objective_trace=np.array(trace),
        )


def _numbers_at(objective: Objective, vector: FloatArray) -> tuple[float, FloatArray] | None:
    """Value and gradient, or None where they are no numbers."""
    if not np.all(np.isfinite(vector)):
        return None
    with np.errstate(over="ignore", invalid="ignore"):
        value, gradient = objective.evaluate(vector)
    return (value, gradient) if np.isfinite(value) and np.all(np.isfinite(gradient)) else None


def _explained(message: str, value: float, trace: list[float]) -> str:
    """With why steps ran out, where they are too long rather than too few."""
    if message == OUT_OF_STEPS and trace and value < max(trace):
        return f"{message}; the objective fell on the way, use a smaller step_size"
    return message
