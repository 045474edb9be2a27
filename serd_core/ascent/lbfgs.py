"""Limited-memory BFGS of scipy.optimize, stopped by the gradient and nothing weaker."""

from dataclasses import dataclass, field

import numpy as np
import scipy.optimize

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
    evaluate_at,
    largest,
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
        self, objective: Objective, start: FloatArray, observer: StepObserver
    ) -> AscentResult:
        """Climb; where the line search stalls by rounding it is started afresh once."""
        run = _Run(objective=objective, observer=observer)
        run.move_to(np.array(start, dtype=np.float64))
        message = ""
        for _ in range(2):
            if run.stopped or self._done(run):
                break
            message = self._climb(run, run.vector)
        converged = run.gradient_norm <= self.gradient_tolerance
        return AscentResult(
            vector=run.vector,
            objective=run.value,
            gradient_norm=run.gradient_norm,
            n_steps=len(run.trace),
            n_evaluations=run.n_evaluations,
            converged=converged,
            message=self._message(run, converged, message),
            objective_trace=np.array(run.trace),
        )

    def _done(self, run: "_Run") -> bool:
        return run.gradient_norm <= self.gradient_tolerance or len(run.trace) >= self.max_steps

    def _message(self, run: "_Run", converged: bool, scipy_message: str) -> str:
        if converged:
            return CONVERGED
        if run.stopped:
            return STOPPED
        if len(run.trace) >= self.max_steps:
            return OUT_OF_STEPS
        return f"not converged: {scipy_message}"

    def _climb(self, run: "_Run", start: FloatArray) -> str:
        result = scipy.optimize.minimize(
            run.negated,
            start,
            jac=True,
            method="L-BFGS-B",
            callback=run.after_step,
            options={
                "maxiter": self.max_steps - len(run.trace),
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
    """Book-keeping of one ascent: scipy's callback does not pass the gradient on."""

    objective: Objective
    observer: StepObserver
    n_evaluations: int = 0
    trace: list[float] = field(default_factory=list)
    stopped: bool = False
    vector: FloatArray = field(default_factory=lambda: np.full(1, np.nan))
    value: float = -np.inf
    gradient: FloatArray = field(default_factory=lambda: np.zeros(0))

    @property
    def gradient_norm(self) -> float:
        return largest(self.gradient)

    def negated(self, vector: FloatArray) -> tuple[float, FloatArray]:
        self.move_to(vector)
        return -self.value, -self.gradient

    def move_to(self, vector: FloatArray) -> None:
        """Evaluate at `vector` unless that was the last evaluation."""
        if not np.array_equal(vector, self.vector):
            self.vector = vector.copy()
            self.value, self.gradient = evaluate_at(self.objective, self.vector)
            self.n_evaluations += 1

    def after_step(self, intermediate_result: scipy.optimize.OptimizeResult) -> None:
        self.move_to(np.asarray(intermediate_result.x))
        self.trace.append(self.value)
        step = Step(
            len(self.trace), self.value, self.gradient_norm, self.n_evaluations, self.vector
        )
        if self.observer(step):
            self.stopped = True
            raise StopIteration
